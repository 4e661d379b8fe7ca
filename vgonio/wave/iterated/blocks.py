"""Blocks of points that an observer sees as a whole: taken together at a few nodes where they are far enough.

Towards a tile of observers a block of BLOCK × BLOCK sources differs from a plane wave along the line between the two
middles by little: without that phase, what a source sends is a smooth function of its place on the surface, and
Lagrange's polynomials at n × n of the block's own points replace all of them (directional interpolation: Brandt 1991;
Engquist and Ying 2007; Messner, Schanz and Darve 2012). What an observer sees of a block in part is summed point by
point, so that shadows stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
BLOCK = 8  # points along a side of a block
NODES = {3: (0, 3, 7), 4: (0, 2, 5, 7), 5: (0, 1, 4, 6, 7)}  # the points next to Chebyshev's nodes
# nodes along a side → from how many pitches away, and the error that this makes of the fields on most surfaces
LEVELS = (({4: 13, 3: 64}, 1e-2), ({5: 25, 4: 64}, 3e-3), ({5: 50, 4: 128}, 1e-3))
LEAST = 1e-3  # error of the fields that is asked for where tol is smaller
FEWEST = 100_000  # points of a patch from which on blocks can pay
WHOLE = 0.5  # share of visible pairs in blocks that are seen as a whole, from which on they do


@dataclass(frozen=True, eq=False)
class Rules:
    """How many nodes do from which distance on.

    distances : (rules,) µm, falling;  nodes : (rules, 1 + BLOCK) how many along a side, and which points of a block
    polynomials : (rules, BLOCK, BLOCK) Lagrange's of a node at the points
    """

    distances: Singles
    nodes: NDArray[np.int32]
    polynomials: Singles

    @staticmethod
    def of(distances: dict[int, float]) -> Rules:
        """From the least distance in µm at which so many nodes along a side do."""
        nodes = np.zeros((len(distances), 1 + BLOCK), np.int32)
        polynomials = np.zeros((len(distances), BLOCK, BLOCK), np.float32)
        order = sorted(distances)
        for rule, n in enumerate(order):
            at = NODES[n]
            nodes[rule, : 1 + n] = n, *at
            for m, node in enumerate(at):
                others = np.array([o for o in at if o != node], float)
                t = np.arange(BLOCK)[:, None]
                polynomials[rule, m] = np.prod((t - others) / (node - others), axis=1)
        return Rules(np.array([distances[n] for n in order], np.float32), nodes, polynomials)


def levels(tol: float, pitch: float) -> list[Rules]:
    """Rules for points `pitch` µm apart, more and more careful, from those on that mostly keep errors below `tol`."""
    fit = [i for i, (_, error) in enumerate(LEVELS) if error <= tol]
    return [
        Rules.of({n: d * pitch for n, d in distances.items()})
        for distances, _ in LEVELS[fit[0] if fit else len(LEVELS) - 1 :]
    ]

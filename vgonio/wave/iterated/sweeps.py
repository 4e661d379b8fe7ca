"""Diffraction: forward–backward sweeps over a profile, from the iterated field towards the full solution.

One sweep goes once along the points from left to right and once back; each block of points takes the latest field of
all others, seen or not, and solves for its own. Point by point this is the forward–backward method (Holliday, DeRaad
and St-Cyr 1996), also called that of ordered multiple interactions (Kapp and Brown 1996). Its generalised form
(Pino et al. 1999) solves one block directly, the surroundings of a target on the surface; here all blocks are solved
so, all of one size: a symmetric block Gauss–Seidel iteration. So light bends around edges of shadows, creeps, and the
material behind them is dark because fields cancel there, not because it is said to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..quadrature import Complex, Floats
from .equation import Equation

BLOCK = 64  # points that are solved for together
LOST = 0.3  # mean square change from the second sweep on with which more of them would not settle
KEPT = 16_000_000  # entries of a matrix up to which it is kept between passes: 256 MB


@dataclass(frozen=True, eq=False)
class Swept:
    """Fields u, v (n, t) after the sweeps; `change` (t,): of the last sweep, mean square over that of the field."""

    u: Complex
    v: Complex
    done: int
    change: Floats


def sweep(
    equation: Equation, incident: tuple[Complex, Complex], start: tuple[Complex, Complex], most: int, tol: float,
    block: int = BLOCK,
) -> Swept:  # fmt: skip
    """At most `most` sweeps, fewer where the mean square change of the field falls to `tol` of the field's or where it
    stays large.

    incident : u, v of the light alone, everywhere, (n, t);  start : fields to begin with, (n, t)
    block : points that are solved for together
    """
    from threadpoolctl import threadpool_limits

    right, x = equation.right(*incident), equation.unknown(*start).copy()
    weight = np.repeat(equation.curve.ds, equation.unknowns)
    rows = _Rows(equation, block)
    done, change = 0, np.ones(x.shape[1])
    with threadpool_limits(1, user_api="blas"):  # blocks are small: threads would wait for each other
        while done < most and np.any(change > tol):
            before = x.copy()
            _pass(rows, right, x)
            change = weight @ np.abs(x - before) ** 2 / np.maximum(weight @ np.abs(x) ** 2, 1e-300)
            done += 1
            if done > 1 and np.all(change > LOST):
                break
    u, v = equation.fields(x)
    return Swept(u, v, done, change)


def _pass(rows: _Rows, right: Complex, x: Complex) -> None:
    """One sweep of x, in place. The last block on the way out is the first on the way back: once is enough."""
    for i in [*range(rows.count), *range(rows.count - 2, -1, -1)]:
        part, a = rows.block(i)
        own = a[:, part]
        x[part] = np.linalg.solve(np.eye(len(own)) - own, right[part] + a @ x - own @ x[part])


class _Rows:
    """Blocks of rows of A, kept where they are few."""

    def __init__(self, equation: Equation, size: int) -> None:
        n, c = len(equation.curve), equation.unknowns
        self.equation, self.size, self.count = equation, size, int(np.ceil(n / size))
        self.keep = (n * c) ** 2 <= KEPT
        self.kept: dict[int, Complex] = {}

    def block(self, i: int) -> tuple[slice, Complex]:
        """The unknowns of block i, and their rows."""
        n, c = len(self.equation.curve), self.equation.unknowns
        first, last = i * self.size, min((i + 1) * self.size, n)
        found = self.kept.get(i)
        if found is None:
            found = self.equation.rows(first, last)
            if self.keep:
                self.kept[i] = found
        return slice(first * c, last * c), found

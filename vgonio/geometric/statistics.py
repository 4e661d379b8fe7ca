"""How far light goes between its first and its last reflection, and what the last facet looks like.

Geometry alone: every path counts once, whatever it loses, so nothing here depends on the wavelength. A sample of rays
of its own is followed hit by hit, over as many periods as they cross.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..directions import Incoming
from ..surface.mesh import Mesh
from .beam import Scene, Starts, rays_of_source
from .trace import next_facet

Floats = NDArray[np.float64]
MOST_RAYS = 50_000  # per angle of incidence: means to half a per cent
DISTANCES = 12  # of the second hit, from one cell to the whole sample
Variables = dict[str, tuple[tuple[str, ...], Any]]


@dataclass(frozen=True)
class Followed:
    """Rays from their first to their last facet; (n,) each, (n, 2) offsets in µm."""

    bounces: NDArray[np.int64]
    escaped: NDArray[np.bool_]
    length: Floats  # µm of path between the first and the last hit
    offset: Floats  # horizontally, from the first to the last hit
    second: Floats  # and to the second hit
    slope: Floats  # (n, 2) of the last facet


def follow(scene: Scene, incoming: Incoming, i: int, n: int, rng: np.random.Generator, max_bounces: int) -> Followed:
    """Follow n rays of incidence i."""
    mesh = scene.mesh
    position = Starts(scene.required_area(incoming, i), mesh.z_range[1], n).draw(rng)
    direction, _ = rays_of_source(incoming, i, n, rng)
    out = Followed(np.zeros(n, np.int64), np.zeros(n, bool), np.zeros(n), *(np.zeros((n, 2)) for _ in range(3)))
    ray = np.arange(n)
    for k in range(max_bounces + 1):
        facet, point, escaped = next_facet(mesh, scene.tracer, position, direction)
        out.escaped[ray[escaped]] = True
        go = np.flatnonzero(facet >= 0)
        if k == max_bounces or len(go) == 0:
            break
        ray, start, position, direction = ray[go], position[go], point[go], direction[go]
        if k > 0:
            step = travelled(mesh, start, position, direction)
            out.length[ray] += step
            out.offset[ray] += step[:, None] * direction[:, :2]
        if k == 1:
            out.second[ray] = out.offset[ray]
        normal, _ = mesh.planes(facet[go])
        out.slope[ray] = -normal[:, :2] / np.maximum(normal[:, 2:], 1e-9)
        out.bounces[ray] += 1
        direction = direction - 2 * np.einsum("ij,ij->i", direction, normal)[:, None] * normal
        position = position + mesh.lift * normal
    return out


def travelled(mesh: Mesh, start: Floats, end: Floats, direction: Floats) -> Floats:
    """(n,) lengths of straight ways from start (n, 3) along unit vectors to end, known up to whole periods.

    The height says how many periods were crossed; on level ways it is the fewest, as an earlier copy of the same facet
    would have been met first.
    """
    way = end - start
    if mesh.period is None:
        return np.einsum("ij,ij->i", way, direction)
    row, axis = np.arange(len(way)), np.argmax(np.abs(direction[:, :2]), axis=1)
    along, ahead = direction[row, axis], way[row, axis]
    period = np.where(along < 0, -1.0, 1.0) * np.array(mesh.period)[axis]
    rises, slants = np.abs(direction[:, 2]) > 1e-6, np.abs(along) > 1e-6
    by_height = way[:, 2] / np.where(rises, direction[:, 2], 1.0)
    fewest = np.ceil(-ahead / period - 1e-9)
    periods = np.where(rises, np.round((by_height * along - ahead) / period), fewest)
    return np.where(slants, (ahead + periods * period) / np.where(slants, along, 1.0), by_height)


def statistics_variables(
    scenes: Sequence[Scene], incoming: Incoming, kept: int, rays: int, max_bounces: int, seed: int
) -> tuple[Variables, dict[str, Any]]:
    """Variables and coordinates of the path statistics, (theta_i, bounce) of the rays that left upward.

    bounce = 1 … kept, the last gathers the rest. Where no path has so many reflections the means are 0 and
    `paths_followed` says so.
    """
    mesh = max((scene.mesh for scene in scenes), key=lambda mesh: len(mesh.faces))
    x0, x1, y0, y1 = mesh.box
    cell = np.sqrt((x1 - x0) * (y1 - y0) / len(mesh.faces))
    distance = np.geomspace(cell, max(x1 - x0, y1 - y0), DISTANCES)
    towards = np.array([np.cos(np.deg2rad(incoming.phi_deg)), np.sin(np.deg2rad(incoming.phi_deg))])
    rows = []
    for i in range(len(incoming.theta_deg)):
        rng = np.random.default_rng([seed, i, 1])
        rows.append(
            _of_one_angle(follow(scenes[i], incoming, i, min(rays, MOST_RAYS), rng, max_bounces), kept, distance)
        )
        rows[-1]["last_facet_slope_mean"] = rows[-1].pop("slope_mean") @ towards
    variables: Variables = {
        name: (("theta_i", "distance" if name == "second_hit_beyond" else "bounce"), np.stack([r[name] for r in rows]))
        for name in rows[0]
    }
    return variables, {"distance": distance}


def _of_one_angle(paths: Followed, kept: int, distance: Floats) -> dict[str, Floats]:
    left = paths.escaped & (paths.bounces > 0)
    place = np.minimum(paths.bounces[left], kept) - 1
    count = np.bincount(place, minlength=kept)

    def mean(values: Floats) -> Floats:
        return np.bincount(place, values[left], kept) / np.maximum(count, 1)

    second = np.linalg.norm(paths.second[paths.bounces > 1], axis=1)
    return {
        "paths_followed": count.astype(float),
        "path_length": mean(paths.length),
        "path_length_rms": np.sqrt(mean(paths.length**2)),
        "horizontal_distance": mean(np.linalg.norm(paths.offset, axis=1)),
        "last_facet_slope_rms": np.sqrt(mean((paths.slope**2).sum(axis=1))),
        "slope_mean": np.stack([mean(paths.slope[:, 0]), mean(paths.slope[:, 1])], axis=-1),
        "second_hit_beyond": (second[:, None] > distance).mean(axis=0) if len(second) else np.zeros(len(distance)),
    }

"""Samples: shared where irradiance is continuous, apart across jumps."""

from __future__ import annotations

import numpy as np

from solver.illumination.interpolation.samples import NUDGE, place_samples
from solver.types import FloatArray, IntArray
from tests.illumination.fine import edge, triangulated
from tests.transport.solving import shelf, solved

SOLVER = solved(shelf(), 0.02)
FLOOR = 0


def places(mesh_position: FloatArray, triangles: IntArray) -> FloatArray:
    v = mesh_position[triangles]
    return np.stack(
        [
            v[:, 0],
            (v[:, 0] + v[:, 1]) / 2,
            v[:, 1],
            (v[:, 1] + v[:, 2]) / 2,
            v[:, 2],
            (v[:, 2] + v[:, 0]) / 2,
        ],
        axis=1,
    )


def test_samples_lie_where_their_triangles_have_them() -> None:
    mesh = triangulated(SOLVER)
    samples = place_samples(mesh)
    wanted = places(mesh.position, mesh.triangles)
    size = np.linalg.norm(wanted[:, 0] - wanted[:, 2], axis=1) + np.linalg.norm(
        wanted[:, 0] - wanted[:, 4], axis=1
    )
    off = np.linalg.norm(samples.position[samples.node] - wanted, axis=2)
    assert np.all(off <= 4.0 * NUDGE * size.max())
    inner = np.linalg.norm(off, axis=1) == 0.0
    assert inner.any() and not inner.all(), "those at the borders of patches lie inside"


def test_without_jumps_every_place_of_a_patch_is_one_sample() -> None:
    mesh = triangulated(SOLVER)
    samples = place_samples(mesh)
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert len(samples.position) == len(mesh.position) + len(np.unique(edges, axis=0))
    assert np.array_equal(np.unique(samples.node), np.arange(len(samples.position)))


def test_a_jump_parts_the_samples_on_it_and_no_others() -> None:
    plain = place_samples(triangulated(SOLVER, edge(FLOOR, [0.1, 0.37, 0.0], [0.83, 0.37, 0.0], False)))
    mesh = triangulated(SOLVER, edge(FLOOR, [0.1, 0.37, 0.0], [0.83, 0.37, 0.0], True))
    samples = place_samples(mesh)
    on = np.count_nonzero(mesh.edge_jump) // 2
    assert on > 2
    # A middle more for each edge, and a corner more for each vertex but the two ends.
    assert len(samples.position) - len(plain.position) == on + (on - 1)
    t, k = np.nonzero(mesh.edge_jump)
    for a, b in zip(t, k, strict=True):
        other = mesh.neighbour[a, b]
        here = samples.position[samples.node[a, 2 * b + 1]]
        assert here[1] != 0.37 and (here[1] > 0.37) == (
            mesh.position[mesh.triangles[a]].mean(axis=0)[1] > 0.37
        )
        assert samples.node[a, 2 * b + 1] not in samples.node[other]

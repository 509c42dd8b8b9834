"""The transport operator: self-adjoint, light by light what the links say, and linear on every element."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.pushpull import gather, irradiance, means, pull, push
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.transport.state import TransportState
from solver.types import FloatArray
from tests.transport.solving import (
    finish,
    furnace,
    inner,
    leaves_of,
    lit_cube,
    random_functions,
    shelf,
    solver_of,
    state_of,
)

SEED = st.integers(0, 1 << 30)


@cache
def scene(name: str) -> RadiositySolver:
    made = {
        "open": shelf(),
        "closed": lit_cube(),
        "coloured": lit_cube((0.7, 0.5, 0.2), (3.0, 2.0, 1.0)),
        "furnace": furnace(0.5),
    }[name]
    return finish(solver_of(made, SolverSettings(error_tolerance=0.03, max_elements=3000)))


def pulled(tree: ElementTree, functions: FloatArray) -> FloatArray:
    moments = np.empty_like(functions)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, functions, moments)
    return moments


@pytest.mark.parametrize("name", ["open", "closed", "coloured", "furnace"])
@settings(max_examples=10)
@given(seed=SEED)
def test_operator_is_self_adjoint(name: str, seed: int) -> None:
    state = state_of(scene(name))
    a, b = random_functions(state, seed), random_functions(state, seed + 1)
    there, back = inner(state, a, state.gather(b)), inner(state, state.gather(a), b)
    size = np.sqrt(inner(state, a, a) * inner(state, b, b))
    assert there == pytest.approx(back, abs=1e-12 * size)


@settings(max_examples=20)
@given(seed=SEED)
def test_push_is_the_adjoint_of_pull(seed: int) -> None:
    """Sum over all elements of functions times pulled moments is the integral of what they push to leaves."""
    state = state_of(scene("open"))
    tree = state.tree
    leaf_functions = random_functions(state, seed)
    moments = pulled(tree, leaf_functions)
    everywhere = np.random.default_rng(seed + 1).normal(size=moments.shape)
    everywhere[:, 1:] /= np.sqrt(tree.area)[:, None, None]
    received = everywhere.copy()
    push(tree.parent, tree.offset, received)
    elements = float((tree.area[:, None, None] * everywhere * moments).sum())
    assert inner(state, received, leaf_functions) == pytest.approx(elements, rel=1e-10, abs=1e-10)


@settings(max_examples=20)
@given(seed=SEED)
def test_what_is_linear_on_a_patch_stays_itself(seed: int) -> None:
    """Pushed to the leaves and pulled up again, a linear function has the moments it had."""
    state = state_of(scene("open"))
    tree = state.tree
    function = np.zeros((len(tree), 3, 1))
    patches = np.arange(tree.patch_count)
    function[patches] = np.random.default_rng(seed).normal(size=(len(patches), 3, 1))
    pushed = function.copy()
    push(tree.parent, tree.offset, pushed)
    leaf = leaves_of(state)
    # At a leaf's centroid it has the value that the patch's function has there.
    at = tree.patch[leaf]
    step = np.einsum("nx,nkx->nk", tree.centroid[leaf] - tree.centroid[at], tree.axes[at])
    expected = function[at, 0, 0] + (step * function[at, 1:, 0]).sum(axis=1)
    np.testing.assert_allclose(pushed[leaf, 0, 0], expected, atol=1e-12)
    up = pulled(tree, pushed)[patches, :, 0]
    uu, uv, vv = tree.moment[patches].T
    _, gu, gv = function[patches, :, 0].T
    np.testing.assert_allclose(up[:, 0], function[patches, 0, 0], atol=1e-12)
    np.testing.assert_allclose(up[:, 1], uu * gu + uv * gv, atol=1e-12)
    np.testing.assert_allclose(up[:, 2], uv * gu + vv * gv, atol=1e-12)


def test_constants_give_the_row_sums_of_the_links() -> None:
    state = state_of(scene("open"))
    tree, links = state.tree, state.links
    one = np.zeros((len(tree), 3, 1))
    one[:, 0] = 1.0
    plain = np.ones(len(tree)), np.zeros((len(tree), 3))
    received = means(tree, irradiance(tree, links, *plain, one))[: tree.patch_count, 0]
    expected = np.zeros(tree.patch_count)
    for end in (links.p, links.q):
        np.add.at(expected, tree.patch[end], links.exchange)
    np.testing.assert_allclose(received, expected / tree.area[: tree.patch_count], rtol=1e-12)


def test_one_link_is_the_kernel_that_it_says() -> None:
    """G / (Ap Aq) (v + a . x + b . y), integrated with a dense sum over both ends."""
    p, q = np.array([0], dtype=np.int32), np.array([1], dtype=np.int32)
    exchange, slope = np.array([0.3]), (np.array([[0.1, -0.2]]), np.array([[0.05, 0.4]]))
    # Rectangles 2 m x 1 m and 1 m x 3 m about their centroids.
    sides = np.array([[2.0, 1.0], [1.0, 3.0]])
    area = sides.prod(axis=1)
    function = np.array([[0.7, 0.2, -0.1], [1.3, -0.5, 0.25]])
    moments = function.copy()
    moments[:, 1:] *= sides**2 / 12.0
    received = np.zeros((2, 3, 1))
    gather(p, q, exchange, *slope, area, moments[:, :, None], 0, len(p), received)
    middle = (np.arange(60) + 0.5) / 60 - 0.5
    x = np.stack(np.meshgrid(middle * 2.0, middle), axis=-1).reshape(-1, 2)
    y = np.stack(np.meshgrid(middle, middle * 3.0), axis=-1).reshape(-1, 2)
    kernel = exchange[0] + (x @ slope[0][0])[:, None] + (y @ slope[1][0])[None]
    at_x = (kernel @ (function[1, 0] + y @ function[1, 1:])) / len(y) / area[0]
    at_y = (kernel.T @ (function[0, 0] + x @ function[0, 1:])) / len(x) / area[1]
    np.testing.assert_allclose(received[0, 0, 0] + x @ received[0, 1:, 0], at_x, atol=1e-4)
    np.testing.assert_allclose(received[1, 0, 0] + y @ received[1, 1:, 0], at_y, atol=1e-4)


def test_inner_rows_of_the_radiosity_are_ignored() -> None:
    state = state_of(scene("open"))
    functions = random_functions(state, 5)
    spoilt = functions.copy()
    spoilt[~leaves_of(state)] = 1e9
    leaf = leaves_of(state)
    np.testing.assert_array_equal(state.gather(spoilt)[leaf], state.gather(functions)[leaf])


def test_no_links_bring_no_light() -> None:
    state = TransportState.of(lit_cube().surfaces)
    n = len(state.tree)
    received = irradiance(state.tree, LinkTable(), np.ones(n), np.zeros((n, 3)), random_functions(state, 1))
    assert not received.any()

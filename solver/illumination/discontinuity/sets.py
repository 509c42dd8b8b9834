"""Discontinuity sets: the discontinuities of a receiver that lie on one line, and the edges they make
([H 5.5.1, 5.5.4]).

Boxes in a row, or lamps over each other, give many discontinuities on a line, of which a triangulation
must see one. A line of a patch is its angle and its distance from the patch's middle. Lines are grouped by
angle, groups by distance: sorted, a group takes all that is within a tolerance of its first, so that a
chain of nearly equal lines is cut into groups no wider than that, and the order in which discontinuities
come does not matter. A set's line is that of its longest member.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.discontinuity.discontinuities import Discontinuities
from solver.illumination.discontinuity.segments import polygons_of
from solver.kernels import kernel
from solver.transport.elements import plane_axes
from solver.types import BoolArray, FloatArray, Int64Array, IntArray, Points

SAME_LINE: Final = 1e-6
"""Lines of a patch are one if their angles differ by at most this, in radians, and their distances from its
middle by at most this times its size; segments on a line touch if they are no further apart."""

_CUT: Final = 0.2360679775
"""Angles are counted from here to this + pi, so that no common direction lies at the seam."""

_NONE: Final = 0
_KINK: Final = 1
_JUMP: Final = 2


@dataclass(frozen=True, eq=False)
class ActiveEdges:
    """e segments to constrain a triangulation with; those of a set are disjoint but may touch."""

    patch: IntArray
    """(e,)"""
    ends: FloatArray
    """(e, 2, 3) metres, on the patch's plane"""
    set: IntArray
    """(e,) the discontinuity set"""
    jump: BoolArray
    """(e,) whether irradiance itself may jump, or only a derivative"""

    def __len__(self) -> int:
        return len(self.patch)


@dataclass(frozen=True, eq=False)
class DiscontinuitySets:
    """n sets of d discontinuities, in the order of patch, angle, distance."""

    patch: IntArray
    """(n,)"""
    origin: Points
    """(n, 3) metres, the point of the line that is nearest to the patch's middle"""
    direction: FloatArray
    """(n, 3) unit"""
    touch: FloatArray
    """(n,) m, up to which distance segments on the line touch"""
    member: IntArray
    """(d,) the set of each discontinuity"""
    span: FloatArray
    """(d, 2) where each discontinuity begins and ends on its set's line, m from its origin, ascending"""
    jump: BoolArray
    """(d,) whether irradiance itself may jump"""

    def __len__(self) -> int:
        return len(self.patch)

    @property
    def ends(self) -> FloatArray:
        """(d, 2, 3) the discontinuities' ends, moved on to their set's line, metres"""
        origin, direction = self.origin[self.member], self.direction[self.member]
        return np.asarray(origin[:, None] + self.span[:, :, None] * direction[:, None])

    def edges(self, active: BoolArray) -> ActiveEdges:
        """The edges that the active (d,) discontinuities make: their union on each line, cut at jumps' ends.

        [H 5.5.7] takes a set's extremal ends instead, which puts edges where nothing is.
        """
        chosen = np.flatnonzero(active)
        owner, jump = self.member[chosen], self.jump[chosen]
        place = self.span[chosen].T.ravel()
        step = np.where(jump, np.int32(_JUMP), np.int32(_KINK))
        owner, step = np.concatenate([owner, owner]), np.concatenate([step, -step])
        order = np.lexsort((place, owner))
        edge_set = np.empty(len(order), dtype=np.int32)
        edge_span = np.empty((len(order), 2))
        is_jump = np.empty(len(order), dtype=np.bool_)
        found = _sweep(owner[order], place[order], step[order], self.touch, edge_set, edge_span, is_jump)
        edge_set, edge_span = edge_set[:found], edge_span[:found]
        ends = self.origin[edge_set][:, None] + edge_span[:, :, None] * self.direction[edge_set][:, None]
        return ActiveEdges(self.patch[edge_set], ends, edge_set.copy(), is_jump[:found].copy())


def group_discontinuities(surfaces: Surfaces, discontinuities: Discontinuities) -> DiscontinuitySets:
    """The sets of all `discontinuities`."""
    d = discontinuities
    middle = polygons_of(surfaces).middles
    apart = surfaces.corners[:, :, None] - surfaces.corners[:, None]
    size = np.linalg.norm(apart, axis=-1).max(axis=(1, 2), initial=0.0)
    axes = plane_axes(surfaces.normal)
    local = d.ends - middle[d.receiver][:, None]
    flat = np.einsum("dek,dak->dea", local, axes[d.receiver]) / size[d.receiver, None, None]
    along = flat[:, 1] - flat[:, 0]
    angle = np.mod(np.arctan2(along[:, 1], along[:, 0]) - _CUT, np.pi)
    cosine, sine = np.cos(angle + _CUT), np.sin(angle + _CUT)
    between = 0.5 * (flat[:, 0] + flat[:, 1])
    distance = cosine * between[:, 1] - sine * between[:, 0]

    # Groups by angle, then by distance within them.
    member = _grouped(_grouped(d.receiver, angle), distance)
    count = int(member.max(initial=-1)) + 1
    order = np.lexsort((distance, angle, -np.hypot(along[:, 0], along[:, 1]), member))
    longest = order[np.searchsorted(member[order], np.arange(count))]
    patch = d.receiver[longest]
    plane = axes[patch]
    direction = cosine[longest, None] * plane[:, 0] + sine[longest, None] * plane[:, 1]
    across = cosine[longest, None] * plane[:, 1] - sine[longest, None] * plane[:, 0]
    origin = middle[patch] + (distance[longest] * size[patch])[:, None] * across
    span = np.einsum("dek,dk->de", d.ends - origin[member][:, None], direction[member])
    return DiscontinuitySets(
        patch=patch,
        origin=origin,
        direction=direction,
        touch=SAME_LINE * size[patch],
        member=member,
        span=np.sort(span, axis=1),
        jump=d.jump,
    )


def _grouped(owner: IntArray, value: FloatArray) -> IntArray:
    """Group numbers of rows that have one owner and values within SAME_LINE of the least; both (d,)."""
    order = np.lexsort((value, owner))
    group = np.empty(len(order), dtype=np.int32)
    _take_groups(order, owner, value, group)
    return group


@kernel
def _take_groups(order: Int64Array, owner: IntArray, value: FloatArray, group: IntArray) -> None:
    """Number the groups of rows in their order."""
    number = -1
    first = -1
    for i in order:
        if first < 0 or owner[i] != owner[first] or value[i] - value[first] > SAME_LINE:
            first = i
            number += 1
        group[i] = number


@kernel
def _sweep(
    owner: IntArray,
    place: FloatArray,
    step: IntArray,
    touch: FloatArray,
    edge_set: IntArray,
    edge_span: FloatArray,
    is_jump: BoolArray,
) -> int:
    """Unions of segments on lines, from their ends sorted by line and place; returns how many there are.

    step is what begins (_KINK, _JUMP) or, negative, what ends. Ends that touch are taken as one place.
    """
    found = 0
    kinks = 0
    jumps = 0
    state = _NONE
    since = 0.0
    i = 0
    while i < len(owner):
        at = place[i]
        line = owner[i]
        while i < len(owner) and owner[i] == line and place[i] - at <= touch[line]:
            if abs(step[i]) == _JUMP:
                jumps += 1 if step[i] > 0 else -1
            else:
                kinks += 1 if step[i] > 0 else -1
            i += 1
        now = _NONE
        if jumps > 0:
            now = _JUMP
        elif kinks > 0:
            now = _KINK
        if now == state:
            continue
        if state != _NONE:
            edge_set[found] = line
            edge_span[found, 0] = since
            edge_span[found, 1] = at
            is_jump[found] = state == _JUMP
            found += 1
        state = now
        since = at
    return found

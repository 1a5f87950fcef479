"""Movable bodies that start in the ground or in other bodies.

An engine would push them out within a few steps, at any speed: a half-buried post of 1 m leaves the
ground at more than 10 m/s. So they are set on the surface or held together where they overlap, once
and before any engine, so that all simulators, pictures and files show the same world.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace

from evoros.geometry.overlap import overlap_depth
from evoros.geometry.shapes import Body, Pose
from evoros.world.joining import fix_body, group_pairs, join_bodies
from evoros.world.lifting import Lifts, find_lifts
from evoros.world.solids import SLACK_M, Solids
from evoros.world.sunk import find_sunk

_LOG = logging.getLogger(__name__)

_Pairs = dict[tuple[int, int], float]
"""The depths [m] of the overlaps of pairs of bodies, of which the first is movable."""


def free_bodies(bodies: Sequence[Body], source: str) -> tuple[Body, ...]:
    """Return the bodies, of which no movable one starts in the ground or in another body.

    A body is lifted out of the ground and out of what carries it. Other movable bodies that overlap
    are joined to one body, and those that overlap a fixed body, or are stuck in the ground, are
    fixed: they stay at rest where they are. ``source`` names the world in messages.
    """
    if all(body.mass is None for body in bodies):
        return tuple(bodies)
    solids = Solids.of(bodies)
    sunk, pairs = find_sunk(bodies, solids), _find_pairs(bodies, solids)
    if not sunk and not pairs:
        return tuple(bodies)
    lifts = find_lifts(bodies, solids, sunk)
    if lifts.heights:
        bodies = [_lift(body, lifts.heights.get(i, 0.0)) for i, body in enumerate(bodies)]
        pairs = _find_pairs(bodies, Solids.of(bodies))
    _tell_lifts(bodies, lifts, source)
    return _hold(bodies, pairs, lifts, source)


def _lift(body: Body, height: float) -> Body:
    if height == 0.0:
        return body
    x, y, z = body.pose.position
    return replace(body, pose=Pose((x, y, z + height), body.pose.quaternion))


def _find_pairs(bodies: Sequence[Body], solids: Solids) -> _Pairs:
    """Return the pairs of bodies that overlap."""
    pairs: _Pairs = {}
    for shape, i in enumerate(solids.body.tolist()):
        if bodies[i].mass is None:
            continue
        for other in solids.list_near(shape, axes=3):
            j = int(solids.body[other])
            if bodies[j].mass is not None and j < i:
                continue
            depth = overlap_depth(solids.shapes[shape], solids.shapes[other])
            if depth > SLACK_M:
                pairs[i, j] = max(pairs.get((i, j), 0.0), depth)
    return pairs


def _hold(bodies: Sequence[Body], pairs: _Pairs, lifts: Lifts, source: str) -> tuple[Body, ...]:
    """Join or fix the bodies that still overlap."""
    groups = group_pairs([*pairs, *((i, i) for i in lifts.stuck)])
    fixed = {
        i
        for group in groups
        if any(bodies[i].mass is None or i in lifts.stuck for i in group)
        for i in group
        if bodies[i].mass is not None
    }
    joined = [group for group in groups if fixed.isdisjoint(group)]
    _tell_fixed(bodies, pairs, fixed, lifts, source)
    _tell_joined(bodies, pairs, joined, source)
    held = [fix_body(body) if i in fixed else body for i, body in enumerate(bodies)]
    for group in joined:
        held[group[0]] = join_bodies([bodies[i] for i in group])
    absent = {i for group in joined for i in group[1:]}
    return tuple(body for i, body in enumerate(held) if i not in absent)


def _tell_lifts(bodies: Sequence[Body], lifts: Lifts, source: str) -> None:
    depths = lifts.depths
    if not depths:
        return
    deepest = max(depths, key=depths.__getitem__)
    carried = len(lifts.heights) - len(depths)
    _LOG.warning(
        "%s: %s in the ground or in a body below, at most by %.3g m (%r); lifted to the surface%s; "
        "correct <pose> for another place",
        source,
        _count(len(depths), "starts", "start"),
        depths[deepest],
        bodies[deepest].name,
        f", with {carried} on top" if carried else "",
    )


def _tell_fixed(
    bodies: Sequence[Body], pairs: _Pairs, fixed: set[int], lifts: Lifts, source: str
) -> None:
    if not fixed:
        return
    depths = {i: (depth, "the ground") for i, depth in lifts.stuck.items()}
    for (i, j), depth in pairs.items():
        if bodies[j].mass is None:
            depths[i] = max(depths.get(i, (0.0, "")), (depth, repr(bodies[j].name)))
    deepest = max(depths, key=depths.__getitem__)
    depth, other = depths[deepest]
    _LOG.warning(
        "%s: %s in fixed bodies, or in bodies that do, at most by %.3g m (%r in %s); fixed in "
        "place, so that no robot pushes them; correct <pose> to part the bodies",
        source,
        _count(len(fixed), "starts", "start"),
        depth,
        bodies[deepest].name,
        other,
    )


def _tell_joined(
    bodies: Sequence[Body], pairs: _Pairs, groups: Sequence[Sequence[int]], source: str
) -> None:
    if not groups:
        return
    members = {i for group in groups for i in group}
    depth, i, j = max((depth, i, j) for (i, j), depth in pairs.items() if i in members)
    _LOG.warning(
        "%s: %s in one another, at most by %.3g m (%r in %r); they move as %s; correct <pose> to "
        "part the bodies",
        source,
        _count(len(members), "starts", "start"),
        depth,
        bodies[i].name,
        bodies[j].name,
        "one body" if len(groups) == 1 else f"{len(groups)} bodies",
    )


def _count(number: int, verb: str, verbs: str) -> str:
    return f"1 movable body {verb}" if number == 1 else f"{number} movable bodies {verbs}"

"""Finds sensors that see their own robot, and sensors whose housings overlap."""

from collections.abc import Iterator, Mapping
from itertools import chain, islice

from evoros.preflight.subject import Subject
from evoros.preflight.trial_designs import try_designs
from evoros.robot.housings import Overlap, find_overlaps, list_housings
from evoros.robot.model import Robot
from evoros.robot.self_sight import SelfSight, find_self_sights


def check_self_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if the robot hides from its sensors a part of what they would see.

    It tries the designs of ``try_designs``.
    """
    robots = [member.robot for member in try_designs(subject)]
    sights = [list(find_self_sights(robot)) for robot in robots]
    worst = max((sight for seen in sights for sight in seen), key=_hidden_share, default=None)
    if worst is not None:
        count = f"in {sum(map(bool, sights))} of {len(robots)} designs that were tried"
        yield f"design: {count}, {_describe_sight(worst)}"


def check_housings(subject: Subject) -> Iterator[str]:
    """Yield a warning if the housings of sensors overlap in every design that is drawn at random.

    Of designs that overlap by chance, a search has others to choose from.
    """
    # The first three have all sensors in the middle or at an end of their regions.
    members = islice(try_designs(subject), 3, None)
    overlaps = [list(find_overlaps(list_housings(member.robot))) for member in members]
    if overlaps and all(overlaps):
        yield (
            f"design: in each of {len(overlaps)} random designs, housings of sensors overlap, at "
            f"most {_describe_overlap(max(chain.from_iterable(overlaps)))}; missions allow it, but "
            f"such a robot cannot be built; make regions larger, or size_m of the sensors smaller"
        )


def check_designs(robots: Mapping[str, Robot]) -> Iterator[str]:
    """Yield a warning for each named robot whose sensors overlap or see it."""
    for name, robot in robots.items():
        overlaps = list(find_overlaps(list_housings(robot)))
        if overlaps:
            yield (
                f"{name}: housings of sensors overlap, at most {_describe_overlap(max(overlaps))}; "
                f"missions allow it, but such a robot cannot be built; move one of them"
            )
        sights = list(find_self_sights(robot))
        if sights:
            yield f"{name}: {_describe_sight(max(sights, key=_hidden_share))}"


def _describe_overlap(overlap: Overlap) -> str:
    return f"{overlap.first} and {overlap.second} by {1e3 * overlap.depth_m:.1f} mm"


def _hidden_share(sight: SelfSight) -> float:
    return sight.hidden_share


def _describe_sight(sight: SelfSight) -> str:
    mount = sight.mount
    return (
        f"the robot hides {100 * sight.hidden_share:.0f} % of the cone of a {mount.sensor} at x "
        f"{mount.x_m:.3g}, y {mount.y_m:.3g}, z {mount.z_m:.3g} m on {mount.link} with yaw "
        f"{mount.yaw_deg:.3g} deg, which sees {sight.link} {sight.distance_m:.3g} m away at some "
        f"steering angle; place it on the outline, facing outwards (OutlineRegion), or move it up"
    )

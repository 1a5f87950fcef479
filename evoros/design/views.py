"""What the sensors of a design space see."""

from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.design.space import DesignSpace
from evoros.optimizer.protocol import View
from evoros.robot.seen import find_seen
from evoros.sensor.protocol import Mount, add_prices


def view_slots(space: DesignSpace, genome: Array, distance_m: float) -> tuple[list[View], View]:
    """Return what each slot sees at a distance, and what the fixed sensors see."""

    def view(mounts: Sequence[Mount], place: str = "") -> View:
        sensors = space.design.sensors
        seen = find_seen(space.robot.with_sensors(mounts, sensors), distance_m)
        return View(seen.sum(axis=0, dtype=np.int64), add_prices(mounts, sensors), place)

    slots = space.mount_slots(genome)
    places = (region if space.design.exclusive else "" for _, region in slots)
    return [view(mounts, place) for (mounts, _), place in zip(slots, places, strict=True)], view(
        space.fixed
    )

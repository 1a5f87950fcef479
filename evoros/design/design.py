"""What distinguishes one individual from another."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from evoros.sensor.protocol import Mount


@dataclass(frozen=True)
class Design:
    """What distinguishes one individual: its sensors, and other evolved values by their key.

    ``values`` maps the key of a configuration value (``controller.avoidance.range_m``) to the
    value that this individual has instead of the configured one.
    """

    mounts: tuple[Mount, ...]
    values: Mapping[str, float] = field(default_factory=dict)

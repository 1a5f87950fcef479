"""The design of an individual."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from evoros.sensor.protocol import Mount


@dataclass(frozen=True)
class Design:
    """The evolved parts of an individual: sensors, and values by key.

    ``values`` maps a configuration key (``controller.avoidance.range_m``) to the value that
    replaces the configured value. ``agents`` holds the designs of other robots with separate
    designs; all remaining robots share this design.
    """

    mounts: tuple[Mount, ...]
    values: Mapping[str, float] = field(default_factory=dict)
    agents: Mapping[str, "Design"] = field(default_factory=dict)

    @classmethod
    def join(cls, parts: Mapping[str, "Design"]) -> "Design":
        """Return the design composed of ``parts``, keyed by robot name; "" is the first robot."""
        agents = dict(parts)
        return replace(agents.pop(""), agents=agents)

    @property
    def parts(self) -> Mapping[str, "Design"]:
        """The designs of all robots that have one, by name; "" is the first robot."""
        return {"": self, **self.agents}

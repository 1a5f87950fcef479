"""The design of an individual."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from evoros.sensor.protocol import Mount


@dataclass(frozen=True)
class Design:
    """The evolved parts of an individual: its sensors, and other values by their key.

    ``values`` maps the key of a configuration value (``controller.avoidance.range_m``) to the
    value that replaces the configured one. ``agents`` has the designs of the other robots that have
    their own; the rest share this one.
    """

    mounts: tuple[Mount, ...]
    values: Mapping[str, float] = field(default_factory=dict)
    agents: Mapping[str, "Design"] = field(default_factory=dict)

    @classmethod
    def join(cls, parts: Mapping[str, "Design"]) -> "Design":
        """Return the design that has these ``parts``."""
        agents = dict(parts)
        return replace(agents.pop(""), agents=agents)

    @property
    def parts(self) -> Mapping[str, "Design"]:
        """The designs of all robots that have their own, by name: "" for the top level."""
        return {"": self, **self.agents}

"""A mission of a design, and the key of its random draws."""

from dataclasses import dataclass

from evoros.design.design import Design


@dataclass(frozen=True)
class Mission:
    """A design in a world under given draws. With a scenario it determines the outcome."""

    generation: int
    design_id: int
    design: Design
    world: str
    trial: int
    purpose: str  # selection, confirmation, validation, final or evaluation
    draws: str  # the key of all random draws

    @property
    def key(self) -> "MissionKey":
        """Identifies the mission in its run."""
        return (self.generation, self.design_id, self.world, self.trial)


MissionKey = tuple[int, int, str, int]  # generation, design, world, trial

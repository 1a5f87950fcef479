"""A mission of a design, and the key of its random draws."""

from dataclasses import dataclass

from evoros.design.design import Design
from evoros.failure.case import Case


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
    case: Case | None = None  # for robots that meet cases; None: the failure model draws

    @property
    def conditions(self) -> str:
        """The key of its draws and its case, as its row has them."""
        return name_conditions(self.draws, "" if self.case is None else self.case.text)

    @property
    def key(self) -> "MissionKey":
        """Identifies the mission in its run."""
        return (self.generation, self.design_id, self.world, self.trial)


def name_conditions(draws: str, case: str) -> str:
    """Name a mission's conditions by the key of its draws and the text of its case, if any."""
    return f"{draws} {case}" if case else draws


MissionKey = tuple[int, int, str, int]  # generation, design, world, trial

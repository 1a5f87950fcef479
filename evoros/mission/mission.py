"""A mission of a design, and the key of its random draws."""

from dataclasses import dataclass

from evoros.design.design import Design
from evoros.failure.case import Case


@dataclass(frozen=True)
class Mission:
    """A design in a world under given draws; with a scenario, it determines the outcome."""

    generation: int
    design_id: int
    design: Design
    world: str
    trial: int
    purpose: str  # selection, confirmation, validation, final or evaluation
    draws: str  # key of all random draws
    case: Case | None = None  # stated failure case; None: drawn by the failure model
    setting: str = ""  # name of its scenario's deviation in an evaluation

    @property
    def conditions(self) -> str:
        """The key of its draws, with its case or setting."""
        return name_conditions(self.draws, self.stated)

    @property
    def stated(self) -> str:
        """Its case or setting for the column ``case``; empty if none."""
        return self.setting if self.case is None else self.case.text

    @property
    def key(self) -> "MissionKey":
        """The key of the mission in its run."""
        return (self.generation, self.design_id, self.world, self.trial)


def name_conditions(draws: str, case: str) -> str:
    """Return a mission's conditions: the key of its draws and its case, if any."""
    return f"{draws} {case}" if case else draws


MissionKey = tuple[int, int, str, int]  # generation, design, world, trial

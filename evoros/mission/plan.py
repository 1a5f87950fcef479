"""Which missions score a design, and under which random draws."""

from dataclasses import dataclass, replace

from evoros.design.design import Design
from evoros.mission.mission import Mission

SELECTION, CONFIRMATION = "selection", "confirmation"
VALIDATION, EVALUATION = "validation", "evaluation"
POLICIES = ("generation", "individual", "run")
STOP, WORST = "stop", "worst"


@dataclass(frozen=True)
class Plan:
    """Which missions score a design, and the key of each one's draws."""

    seed: int
    worlds: tuple[str, ...]
    trials: int
    validation_trials: int
    policy: str  # who meets the same draws: a generation, an individual only, or the whole run

    def missions(
        self, purpose: str, generation: int, design_id: int, design: Design
    ) -> list[Mission]:
        """Return the missions of a design for a purpose."""
        plans = {
            SELECTION: self.selection,
            VALIDATION: self.validation,
            CONFIRMATION: self.confirmation,
            EVALUATION: self.evaluation,
        }
        return plans[purpose](generation, design_id, design)

    def selection(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """The missions that give a design its fitness."""
        parts = {
            "generation": f"{generation}",
            "individual": f"{generation}:{design_id}",
            "run": "all",
        }
        return self._missions(
            generation, design_id, design, SELECTION, parts[self.policy], range(self.trials)
        )

    def validation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Missions under draws that never enter selection: the same ones for every design.

        Their trials are numbered after those of the selection.
        """
        trials = range(self.trials, self.trials + self.validation_trials)
        return self._missions(generation, design_id, design, VALIDATION, "all", trials)

    def confirmation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """The missions of the selection again, under the same draws, for another simulator.

        Their trials are numbered after those of the validation.
        """
        after = self.trials + self.validation_trials
        return [
            replace(mission, trial=after + mission.trial, purpose=CONFIRMATION)
            for mission in self.selection(generation, design_id, design)
        ]

    def evaluation(self, generation: int, design_id: int, design: Design) -> list[Mission]:
        """Missions outside a run, under draws that no run is selected or validated on."""
        return self._missions(
            generation, design_id, design, EVALUATION, f"{generation}", range(self.trials)
        )

    def _missions(
        self,
        generation: int,
        design_id: int,
        design: Design,
        purpose: str,
        part: str,
        trials: range,
    ) -> list[Mission]:
        return [
            Mission(
                generation,
                design_id,
                design,
                world,
                trial,
                purpose,
                f"{self.seed}/{purpose}/{part}/{world}/{trial}",
            )
            for trial in trials
            for world in self.worlds
        ]


def describe(mission: Mission) -> str:
    """For messages: which mission."""
    return (
        f"the mission of design {mission.design_id} in {mission.world}, "
        f"generation {mission.generation}, trial {mission.trial}"
    )

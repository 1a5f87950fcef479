"""The verdicts of evaluations with requirements, and the missions that are worst for them."""

from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from evoros.base.errors import InputError
from evoros.requirement.pipeline import Row
from evoros.requirement.verdict import MET
from evoros.storage.trajectory_files import trajectory_file
from evoros.storage.verdicts import name_worst, read_verdicts

from .designs import adapt_types, place_sensors, place_signals
from .records import EvaluationRecord
from .robots import select_robot
from .shown import ShownDesign, ShownMission
from .study import Study
from .tracks import find_mission_world, load_mission_world

GENERATION = 0
"""Of all missions of an evaluation."""


@dataclass(frozen=True, eq=False)
class Required:
    """A verdict on a requirement of a design."""

    record: EvaluationRecord
    verdict: Row

    @property
    def met(self) -> bool:
        """Whether the requirement is met."""
        return self.verdict["result"] == MET

    @property
    def key(self) -> str:
        """Identifies the verdict in a page."""
        names = ("source", "design", "requirement")
        return "/".join([self.record.name, *(self.verdict[name] for name in names)])

    @property
    def place(self) -> str:
        """The worst mission in words."""
        worst = name_worst(self.verdict)
        return f"trial {worst['trial']} in {worst['world']}"


def list_required(study: Study) -> list[Required]:
    """List the verdicts of all finished evaluations: violated, undecided, then met.

    Raises:
        InputError: nothing was required.
    """
    verdicts = list(_list_verdicts(study))
    if not verdicts:
        raise InputError(
            "requirements: must be given a finished evaluation with requirements, and there is "
            "none; make one with evoros evaluate requirements=..."
        )
    order = ["violated", "undecided", MET]
    return sorted(verdicts, key=lambda required: order.index(required.verdict["result"]))


def _list_verdicts(study: Study) -> Iterator[Required]:
    for record, rows in study.read_each(study.evaluations, lambda each: read_verdicts(each.path)):
        yield from (Required(record, row) for row in rows)


def read_worst(required: Required) -> ShownDesign:
    """Read the design with the mission that is worst for the verdict.

    Raises:
        InputError: the evaluation has not kept its trajectory.
    """
    record, columns = required.record, name_worst(required.verdict)
    missions = record.run.missions
    chosen = pd.concat(
        [missions[name].astype(str) == text for name, text in columns.items()], axis=1
    )
    row = missions[chosen.all(axis=1)].iloc[0]
    key = ["source", "design"]
    mounts = record.mounts.astype(dict.fromkeys(key, str))
    designs = list(mounts.groupby(key, sort=False).groups)
    number = designs.index((columns["source"], columns["design"]))
    mission = (GENERATION, number, columns["world"], int(columns["trial"]))
    if not (record.path / trajectory_file(mission)).is_file():
        raise InputError(
            f"{record.path}: must have kept the trajectory of {required.place}; start it without "
            f"record=none"
        )
    trajectory = record.run.mission_trajectory(*mission)
    world = load_mission_world(record.run, record.context, row)
    ground = f"{record.name}/{find_mission_world(record.run, row).stem}"
    genes = record.genes.astype(dict.fromkeys(key, str))
    own, values = (
        select_robot(table[(table[key] == [columns[name] for name in key]).all(axis=1)])
        for table in (mounts, genes)
    )
    context = adapt_types(record.context, dict(zip(values["key"], values["value"], strict=True)))
    return ShownDesign(
        record,
        columns["design"],
        context,
        place_sensors(own, context),
        place_signals(own, context),
        [ShownMission(row, trajectory, world, ground)],
    )

"""Rows of tables of missions, and the missions of evaluations that they are of."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.evolution.experiment import Experiment
from evoros.failure.case import Case
from evoros.mission.mission import Mission
from evoros.mission.scenario import Scenario
from evoros.session.design_tables import NamedDesign
from evoros.session.evaluation_record import GENERATION
from evoros.session.worst_case_run import state_failures
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import MISSIONS
from evoros.storage.tables import CASE

Row = Mapping[str, str]


def read_rows(path: Path) -> list[Row]:
    """Read the table of the missions of a run or an evaluation."""
    return list(csv.DictReader(read_bytes(path / MISSIONS).decode().splitlines()))


def plan_row(
    experiment: Experiment, designs: Sequence[NamedDesign], row: Row
) -> tuple[Mission, Scenario]:
    """Plan the mission of an evaluation that a row of its table is of."""
    names = [(design.source, design.name) for design in designs]
    index = names.index((row["source"], row["design"]))
    case, purpose = read_case(row), experiment.evaluation_draws
    stated = case is not None and experiment.worst_cases is not None
    scenario = state_failures(experiment) if stated else experiment.scenario_for(purpose)
    key = (GENERATION, index, designs[index].design, row["world"], int(row["trial"]))
    return Mission(*key, purpose, row["draws"], case), scenario


def read_case(row: Row) -> Case | None:
    """Read the stated case of a mission, if it has one."""
    return Case.parse(row[CASE]) if row.get(CASE) else None

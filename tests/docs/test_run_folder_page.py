"""docs/run_folder.md names every file, column and field of a run, in order."""

import json
import re
from typing import Any

import numpy as np
from documents import code, documented, table, text

import evoros
from evoros.config.compose import compose
from evoros.mission.mission import TRAJECTORY
from evoros.storage.champion_files import DESIGN_COLUMNS, GENE_COLUMNS
from evoros.storage.layout import DIGEST
from evoros.storage.tables import (
    CANDIDATE_COLUMNS,
    MEASURED_COLUMNS,
    MISSION_COLUMNS,
    OUTCOME_COLUMNS,
    PART_COLUMNS,
)


def test_the_columns_of_missions_are_documented_in_order() -> None:
    expected = (*MISSION_COLUMNS, *OUTCOME_COLUMNS, DIGEST, *PART_COLUMNS)
    assert tuple(documented("missions.csv")) == expected


def test_the_columns_of_generations_are_documented_in_order() -> None:
    columns, head = documented("generations/NNNNN.csv"), (*CANDIDATE_COLUMNS, *MEASURED_COLUMNS)
    fixed, decoded = columns[: len(head)], columns[len(head) :]
    assert tuple(fixed) == head
    design = ["+sensor@design.sensors.other=sonar", "design.number=[1,2]"]
    ranges = ["+design.regions.front.z_m=[0.1,0.2]", "+design.regions.front.pitch_deg=[0,10]"]
    space = compose([*design, *ranges]).build().space
    known = list(space.to_row(np.zeros(space.size)))
    assert [name.replace("N", "1") for name in decoded] == [
        name for name in known if name.startswith("sensor1_")
    ]
    assert known[-1] == "number"


def test_the_columns_of_the_champion_are_documented_in_order() -> None:
    trajectory = (*TRAJECTORY, "range_N_m")
    assert tuple(documented("champion")) == (*DESIGN_COLUMNS, *GENE_COLUMNS, *trajectory)


def test_the_fields_of_manifest_and_status_are_documented_in_order(finished: evoros.Run) -> None:
    for name in ("manifest.json", "status.json"):
        assert documented(name) == list(json.loads((finished.path / name).read_text()))


def test_the_files_of_a_run_are_documented(finished: evoros.Run) -> None:
    names = {name for row in table(text("run_folder"), "file") for name in row[0].split("`, `")}
    paths = {str(path.relative_to(finished.path)) for path in finished.path.rglob("*.*")}
    numbered = {re.sub(r"\d{5}", "NNNNN", name).replace("_yard", "_WORLD") for name in paths}
    numbered = {re.sub(r"figures/\w+", "figures/NAME", name) for name in numbered}
    assert numbered == names


def test_the_replay_of_a_mission_gives_what_was_recorded(finished: evoros.Run) -> None:
    (block,) = code("run_folder")
    for index in range(len(finished.missions)):
        names: dict[str, Any] = {}
        exec(block.replace("iloc[-1]", f"iloc[{index}]"), names)
        assert names["outcome"].progress == names["row"].progress
        assert names["outcome"].least_clearance_m == names["row"].least_clearance_m

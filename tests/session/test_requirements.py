"""Evaluations with requirements end as soon as all are decided, and say so to pipelines."""

import csv
import shlex
import shutil
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pytest
from fixture_types import Capture, Folders, Patch
from helpers import TINY, copied, refused, reseal, resume, tiny
from junitparser import Failure, JUnitXml

from evoros.cli.command import evaluate
from evoros.cli.main import evoros
from evoros.requirement.requirements import ROUND
from evoros.session.diff import diff_runs
from evoros.session.progress import Progress
from evoros.storage.verdicts import name_worst
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

TWO = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\nb,0,0.1,0,-60\n"
EASY = "{of: time_s, at_least: 0, share: 0.8}"
HARD = "{of: distance_m, at_most: -1, share: 0.8}"
CLOSE = "{of: progress, at_least: 0.5, confidence: 0.999}"
WORLDS = 2


@pytest.fixture(scope="module")
def file(tmp_path_factory: Folders) -> Path:
    path = tmp_path_factory.mktemp("given") / "two.csv"
    path.write_text(TWO)
    return path


def required(folder: Path, file: Path, claims: str, *more: str) -> int:
    places = ("executor=serial", f"hydra.run.dir={folder}", f"designs={file}")
    requirements = [
        f"+requirements.{claim.partition('=')[0]}={claim.partition('=')[2]}"
        for claim in claims.split(" + ")
    ]
    return evaluate([*TINY, *places, "trials=60", *requirements, *more])


def results(folder: Path) -> dict[tuple[str, str], str]:
    return {(row["design"], row["requirement"]): row["result"] for row in read(folder)}


def read(folder: Path) -> list[dict[str, str]]:
    with (folder / "requirements.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def whole(file: Path, tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "tested"
    assert required(folder, file, f"easy={EASY} + hard={HARD}") == NOT_MET
    return folder


def test_it_ends_as_soon_as_all_is_decided(whole: Path) -> None:
    """What every mission keeps takes the longest, and far less than the 60 trials."""
    rows = pd.read_csv(whole / "requirements.csv")
    assert set(zip(rows["requirement"], rows["result"], strict=True)) == {
        ("easy", "met"),
        ("hard", "violated"),
    }
    decided = rows[rows["requirement"] == "easy"]["trials"].max()
    trials = -(-decided // ROUND) * ROUND
    assert trials < 60
    missions = pd.read_csv(whole / "missions.csv")
    assert len(missions) == 2 * WORLDS * trials
    assert set(pd.read_csv(whole / "designs.csv")["trials"]) == {trials}


def test_the_status_tells_a_pipeline(file: Path, tmp_path: Path, monkeypatch: Patch) -> None:
    begun, begin = list[tuple[int, int]](), Progress.begin

    def note(self: Progress, generation: int, missions: int, known: int) -> None:
        begun.append((missions, known))
        begin(self, generation, missions, known)

    monkeypatch.setattr(Progress, "begin", note)
    assert required(tmp_path / "met", file, f"easy={EASY}") == DONE
    totals, known = zip(*begun, strict=True)
    assert len(known) > 2  # of rounds of missions, which are shown as one count that never falls
    assert sorted(set(known)) == list(known)
    assert totals[0] == 2 * WORLDS * 60
    assert sorted(totals, reverse=True) == list(totals)
    assert totals[-1] == known[-1]
    assert required(tmp_path / "open", file, f"close={CLOSE}", "trials=2") == NOT_DECIDED
    assert set(results(tmp_path / "open").values()) == {"undecided"}
    assert resume(tmp_path / "open") == NOT_DECIDED  # as a job of a pipeline that is repeated


@pytest.mark.slow
def test_a_sweep_has_the_worst_status(file: Path, tmp_path: Path) -> None:
    arguments = [*TINY, "executor=serial", f"designs={file}", f"hydra.sweep.dir={tmp_path / 's'}"]
    easy, swept = f"+requirements.easy={EASY}", "requirements.easy.at_least=0,1000"
    status = evaluate(["-m", *arguments, "trials=30", easy, swept])
    assert status == NOT_MET
    states = {frozenset(results(folder).values()) for folder in (tmp_path / "s").iterdir()}
    assert states == {frozenset({"met"}), frozenset({"violated"})}
    assert evaluate(["-m", *arguments, "trials=30", easy, swept]) == NOT_MET  # all is kept


@pytest.mark.slow
def test_workers_and_interruptions_change_no_byte(whole: Path, tmp_path: Path) -> None:
    again = copied(whole, tmp_path / "tested")
    compared = ("missions.csv", "designs.csv", "requirements.csv", "junit.xml", "requirements.md")
    expected = {name: (whole / name).read_bytes() for name in compared}
    for name in compared[1:]:
        (again / name).unlink()
    lines = (again / "missions.csv").read_bytes().splitlines(keepends=True)
    (again / "missions.csv").write_bytes(b"".join([lines[0], *lines[5:60:2]]))
    assert resume(again, "executor=processes", "executor.workers=2") == NOT_MET
    assert {name: (again / name).read_bytes() for name in compared} == expected
    for name in compared[2:]:  # none of them escapes a comparison
        other = tmp_path / name
        shutil.copytree(again, other)
        (other / name).write_text(f"{expected[name].decode()} ")
        reseal(other)
        assert name in diff_runs(whole, other).difference


def test_pipelines_read_the_verdicts(whole: Path) -> None:
    suites = list(JUnitXml.fromfile(str(whole / "junit.xml")))
    assert [(suite.tests, suite.failures, suite.errors) for suite in suites] == [(2, 1, 0)] * 2
    told = {case.name.partition(":")[0]: case.result for suite in suites for case in suite}
    assert told["easy"] == []
    ((failure,),) = [told["hard"]]
    assert isinstance(failure, Failure)
    assert "the worst mission is trial 0 in " in failure.message
    summary = (whole / "requirements.md").read_text()
    claim = "hard: distance_m at most -1 in at least 80 % of the missions"
    assert summary.count(f"| **violated** | {claim} |") == 2


SCHEMA = {
    "testsuites": {"tests", "failures", "errors"},
    "testsuite": {"name", "tests", "failures", "errors"},
    "testcase": {"name", "classname"},
    "failure": {"type", "message"},
}
"""Elements and attributes of junit-10.xsd that are used, among them all that it requires."""


def test_junit_has_what_its_schema_knows_and_requires(whole: Path) -> None:
    root = ElementTree.parse(whole / "junit.xml").getroot()
    levels = (["testsuites"], ["testsuite"], ["testcase"], ["failure"])
    elements = [root]
    for names in levels:
        assert {element.tag for element in elements} == set(names)
        assert all(set(element.attrib) == SCHEMA[names[0]] for element in elements)
        elements = [child for element in elements for child in element]
    assert elements == []


def test_the_worst_mission_is_named_with_the_command_that_replays_it(
    whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = tmp_path / "tested"
    shutil.copytree(whole, folder)
    assert resume(folder) == NOT_MET
    printed = capsys.readouterr().out
    commands = [
        line.partition("replay: ")[2] for line in printed.splitlines() if "replay: " in line
    ]
    assert len(commands) == 2  # designs
    for command in commands:
        name, *words = shlex.split(command)
        track = tmp_path / "track.csv"
        assert name == "evoros"
        assert evoros([*words, "--output", str(track), *TINY[:2]]) == DONE
        assert len(track.read_text().splitlines()) > 2


def test_what_is_undecided_is_a_failure_of_its_own_type(file: Path, tmp_path: Path) -> None:
    assert required(tmp_path / "open", file, f"close={CLOSE}", "trials=1") == NOT_DECIDED
    for suite in JUnitXml.fromfile(str(tmp_path / "open" / "junit.xml")):
        (case,) = suite
        ((failure,),) = [case.result]
        assert (type(failure), failure.type) == (Failure, "undecided")


SURVIVES = "blind={survives: 1, times_s: [0.0]}"


def test_all_cases_of_failed_sensors_are_tried(file: Path, tmp_path: Path) -> None:
    """In plains without obstacles, nothing stops a robot that sees nothing."""
    folder, near = tmp_path / "cases", ("~world.far", "trials=10")
    assert required(folder, file, SURVIVES, *near) == DONE
    for row in read(folder):
        assert (row["result"], row["trials"]) == ("met", "6")
        assert row["claim"].startswith("completed in at least 50 % of the missions in each world")
        assert row["claim"].endswith("with any 1 sensor failed at 0 s")
    missions = pd.read_csv(folder / "missions.csv", keep_default_na=False)
    assert dict(missions.groupby("case").size()) == {"": 20, "0@0.0": 20, "intact": 20}
    intact = missions[missions["case"] == "intact"]
    assert set(intact["failed_sensors"].astype(str)) == {""}
    dead = missions[missions["case"] == "0@0.0"]
    assert set(dead["failed_sensors"].astype(str)) == {"0"}


@pytest.mark.slow
def test_a_design_that_fails_without_a_failure_survives_nothing(file: Path, tmp_path: Path) -> None:
    """No robot completes the far world in its time, so that no case makes it worse."""
    folder = tmp_path / "cases"
    assert required(folder, file, SURVIVES, "trials=10") == NOT_MET
    for row in read(folder):
        assert (row["result"], row["value"], row["worst_world"]) == ("violated", "0.0", "far")
        columns = [f"{name}={value}" for name, value in name_worst(row).items()]
        assert evoros(["replay", str(folder), *columns, *TINY[:2]]) == DONE


def test_a_claim_for_each_failed_sensor_has_a_row_and_a_test_for_each(
    file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "each"
    claims = "near={of: completed, at_least: 0.6, world: near, each: failed_sensor} + place={of: "
    claims += "completed, at_least: 0.4, each: world}"
    assert required(folder, file, claims, "trials=20") == NOT_MET
    results = [(row["requirement"], row["level"], row["result"]) for row in read(folder)]
    assert results[: len(results) // 2] == [
        ("near", "", "met"),
        ("near", "failed_sensor=0@0.0", "met"),
        ("place", "", "violated"),
        ("place", "world=near", "met"),
        ("place", "world=far", "violated"),
    ]
    missions = pd.read_csv(folder / "missions.csv", keep_default_na=False)
    assert set(missions["world"][missions["case"] != ""]) == {"near"}  # the one it is about
    names = [case.name for suite in JUnitXml.fromfile(str(folder / "junit.xml")) for case in suite]
    assert len(names) == len(results)
    assert names[1].startswith(
        "near [failed_sensor=0@0.0]: completed in at least 60 % of the missions in near"
    )


PARTS = (
    "+failure@requirements.mine.each.failure.none=none",
    "+failure@requirements.mine.each.failure.drive=drive",
    *(
        f"requirements.mine.each.failure.drive.{value}"
        for value in ("effect.limit=0.001", "onset.earliest_s=0", "onset.latest_s=0")
    ),
)


@pytest.mark.slow
def test_levels_may_be_other_parts_of_the_experiment(file: Path, tmp_path: Path) -> None:
    """A robot whose drive fails from the start comes nowhere."""
    folder, claim = tmp_path / "parts", "mine={of: progress, at_least: 0.6, world: near}"
    assert required(folder, file, claim, *PARTS, "trials=10") == NOT_MET
    results = {(row["level"], row["result"]) for row in read(folder)}
    assert results == {("", "violated"), ("failure=none", "met"), ("failure=drive", "violated")}
    (row, *_) = read(folder)
    assert row["decided_by"] == "failure=drive"
    columns = [f"{name}={value}" for name, value in name_worst(row).items()]
    assert evoros(["replay", str(folder), *columns, *TINY[:2]]) == DONE
    for name in ("requirements.csv", "junit.xml"):
        (folder / name).unlink()
    assert resume(folder) == NOT_MET


def test_requirements_that_cannot_be_used_are_refused(
    file: Path, tmp_path: Path, capsys: Capture
) -> None:
    for claim, told in (
        ("{of: speed, at_most: 1, share: 0.5}", "requirements.mine.of: must be a measure or one "),
        ("{of: completed, at_least: 1.2}", "requirements.mine: the limit must be between "),
        ("{of: completed}", "requirements.mine: must have either at_least or at_most"),
        ("{of: completed, at_least: 0.5, world: yard}", "requirements.mine.world: must be one of"),
        ("{survives: 2}", "two.csv: requirements.mine.survives: must be at most 1, the number of"),
        ("{of: completed, at_least: 0.5, each: sensor}", "Claim.each: must be failed_sensor, "),
    ):
        folder = tmp_path / "refused"
        error = refused(partial(required, folder, file, f"mine={claim}"), capsys)
        assert told in error
        assert not folder.exists()


def test_a_run_takes_no_requirements(tmp_path: Path, capsys: Capture) -> None:
    error = refused(lambda: tiny(tmp_path / "run", f"+requirements.easy={EASY}"), capsys)
    assert "requirements: cannot be used in a run" in error

"""Scenario files that the real scenario_execution runs on missions of evoros."""

import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from documents import files, write
from scenario_execution.scenario_execution_base import ScenarioExecution
from scenario_execution.utils.logging import BaseLogger

from evoros.base.errors import InputError
from evoros.mission.rollout import run_mission
from evoros.plugins.openscenario import Simulation
from evoros.plugins.openscenario.simulation import build_setting, split_words
from evoros.storage.tables import trajectory_table

PREAMBLE = "import osc.helpers\nimport osc.evoros\n"
PART = "designs=mine/six.csv world=maze seed=3 course.time_limit_s=120"


class Log(BaseLogger):  # type: ignore[misc]
    """Keeps the lines of the tool, without the tree that ends a scenario that fails."""

    def __init__(self) -> None:
        super().__init__("test", False)
        self.lines: list[str] = []

    def info(self, msg: str) -> None:
        self.lines.append(msg)

    warning = error = info

    def debug(self, msg: str) -> None:
        pass


class Ended(NamedTuple):
    passed: bool
    lines: list[str]

    @property
    def problem(self) -> str:
        """The line before the verdict."""
        assert not self.passed
        return self.lines[-2]


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenarios")
    write(files("openscenario"), folder)
    return folder


@pytest.fixture
def run(here: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ended]:
    """Run a scenario file, or the text of one scenario's actions, in the folder ``here``."""
    monkeypatch.chdir(here)

    def run(text: str, output: str | None = None, simulation: type = Simulation) -> Ended:
        file, log = text, Log()
        if "\n" in text or not text.endswith(".osc"):
            file = "written.osc"
            Path(file).write_text(text)
        tool = ScenarioExecution(
            *(False, False, False, file, output),
            logger=log,
            register_signal=False,
            simulation=simulation(),
        )
        if tool.parse():
            tool.run()
        return Ended(tool.process_results(), log.lines)

    return run


def scenario(*actions: str, overrides: str = PART, name: str = "tested") -> str:
    body = "".join(f"        {action}\n" for action in actions)
    return (
        f'{PREAMBLE}\nscenario {name}:\n    overrides: string = "{overrides}"\n'
        f"    do serial:\n{body}"
    )


def test_the_fault_of_the_page_changes_the_verdict(run: Callable[..., Ended], here: Path) -> None:
    faulty = here / "mine" / "lost_sonars.osc"
    lines = faulty.read_text().splitlines(keepends=True)
    whole = "".join(line for line in lines if "inject_fault" not in line)
    assert len(whole.splitlines()) == len(lines) - 1
    assert run(whole).passed
    ended = run("mine/lost_sonars.osc")
    assert "the mission has ended (collision)" in ended.problem


def test_two_runs_leave_the_same_bytes(run: Callable[..., Ended], here: Path) -> None:
    for folder in ("first", "second"):
        run("mine/lost_sonars.osc", folder)
    for name in ("trajectory.csv", "mission.csv"):
        assert (here / "first" / name).read_bytes() == (here / "second" / name).read_bytes()
    (row,) = pd.read_csv(here / "first" / "mission.csv").to_dict("records")
    assert (row["ended"], row["failed_by"]) == ("collision", ";".join(["silence"] * 6))


def test_a_scenario_that_only_waits_has_the_bytes_of_the_mission(
    run: Callable[..., Ended], here: Path
) -> None:
    limited = PART.replace("=120", "=12")
    assert run(scenario('wait_for_end(ended: "time_limit")', overrides=limited), "idle").passed
    setting = build_setting(tuple(limited.split()), None, 0)
    _, track = run_mission(setting.scenario, setting.mission)
    columns = setting.scenario.name_columns(setting.mission.design, setting.mission.world)
    assert (here / "idle" / "trajectory.csv").read_text() == trajectory_table(track, columns)


def test_each_scenario_of_a_file_has_a_mission_and_a_folder(
    run: Callable[..., Ended], here: Path
) -> None:
    one = scenario("wait elapsed(2s)", name="one")
    other = scenario("wait elapsed(3s)", name="other").removeprefix(PREAMBLE)
    assert run(one + other, "both").passed
    times = [
        pd.read_csv(here / "both" / name / "trajectory.csv")["time_s"].iloc[-1]
        for name in ("one", "other")
    ]
    assert times == pytest.approx([2.5, 3.5])  # the tool's first tick is one step after the start


def test_conditions_hold_when_they_say(run: Callable[..., Ended], here: Path) -> None:
    fine = type("Fine", (Simulation,), {"dt": 0.1})
    assert run(scenario("wait elapsed(8s)"), "near", fine).passed
    x, y = pd.read_csv(here / "near" / "trajectory.csv")[["x_m", "y_m"]].iloc[-1]
    near = scenario(f"wait_for_place(x: {x:.3f}m, y: {y:.3f}m, within: 0.25m)")
    assert run(near, "near", fine).passed
    track = pd.read_csv(here / "near" / "trajectory.csv")
    distance = np.hypot(track["x_m"] - round(x, 3), track["y_m"] - round(y, 3))
    assert distance.iloc[-1] <= 0.25 < distance.iloc[:-1].min()

    below = scenario('wait_for_reading(sensors: "0 1", at_most: 2.0)')
    assert run(below, "below", fine).passed
    track = pd.read_csv(here / "below" / "trajectory.csv")
    readings = track[["range_0_m", "range_1_m"]].min(axis=1)
    assert readings.iloc[-1] <= 2.0 < readings.iloc[:-1].min()


def test_readings_reach_variables_and_silence_is_none(run: Callable[..., Ended]) -> None:
    asked = scenario(
        'ask_reading(target_variable: seen, sensors: "sonar")',
        'compare(left_value: seen, operator: ">", right_value: "0.0")',
    )
    typed = asked.replace("    do serial", "    var seen: float = 0.0\n    do serial")
    assert run(typed.replace('"0.0"', "0.0")).passed
    silent = scenario(
        'inject_fault(sensors: "2")',
        'wait_for_silence(sensors: "2")',
        'ask_reading(target_variable: seen, sensors: "2")',
    ).replace("    do serial", "    var seen: float = 0.0\n    do serial")
    assert run(silent).problem == "ask_reading: the sensors 2 are silent"


def test_a_reading_is_asserted_at_once_by_the_modifier_of_the_language(
    run: Callable[..., Ended],
) -> None:
    far = "wait_for_reading(at_least: 1000.0) with:\n            running_is_failure()"
    ended = run(scenario(far))
    assert not ended.passed


def test_a_driven_robot_goes_where_it_is_driven_and_then_its_own_way(
    run: Callable[..., Ended], here: Path
) -> None:
    assert run(scenario("drive(speed: 0.3mps, steering: 0rad, duration: 2s)"), "driven").passed
    track = pd.read_csv(here / "driven" / "trajectory.csv")
    assert (track["steering_rad"].iloc[5:19] == 0.0).all()  # the first tick of a scenario is dt
    kept = scenario("drive(speed: 0.3mps, duration: 2s)", "wait elapsed(3s)")
    assert run(kept, "kept").passed
    assert (pd.read_csv(here / "kept" / "trajectory.csv")["steering_rad"].iloc[-10:] != 0.0).any()


@pytest.mark.slow
def test_a_failure_model_may_choose(run: Callable[..., Ended]) -> None:
    chosen = scenario(
        "wait elapsed(2s)",
        'inject_failure(failure: "given", settings: "sensors=[1] time_s=1")',
        'wait_for_silence(sensors: "1")',
        'check_metric(metric: "time_s", at_least: 3.6, at_most: 4.1)',
    )
    ended = run(chosen)
    assert ended.passed
    assert "inject_failure: silence of 1@3.6" in ended.lines


TWO_WHEELS = PART.replace("maze", "boxes") + " robot=two_wheeler"
FAULTS = {
    "steering": ('effect: "constant", settings: "effect.value=0.4"', PART),
    "drive": ('effect: "constant"', PART),
    "left_wheel": ('settings: "effect.value=0.5"', TWO_WHEELS),
    "localization": ('settings: "effect.distance_m=5 effect.direction_deg=90"', PART),
    "commands": ('effect: "silence"', PART),
    "battery": ('settings: "charge_wh=0.02"', PART),
}
"""The parameters of a fault of each part, and its mission."""


def inject(part: str) -> str:
    if part == "battery":
        return f'inject_failure(failure: "battery", {FAULTS[part][0]})'
    return f'inject_part_fault(part: "{part.removeprefix("left_")}", {FAULTS[part][0]})'


@pytest.mark.parametrize("overrides", [PART, TWO_WHEELS])
def test_a_robot_without_faults_reaches_two_waypoints(
    run: Callable[..., Ended], overrides: str
) -> None:
    """For the next test."""
    assert run(scenario("wait_for_waypoints(count: 2)", overrides=overrides)).passed


@pytest.mark.parametrize(
    "part",
    [part if part == "steering" else pytest.param(part, marks=pytest.mark.slow) for part in FAULTS],
)
def test_a_part_that_fails_at_a_waypoint_keeps_the_robot_from_the_next_one(
    run: Callable[..., Ended], here: Path, part: str
) -> None:
    waits = [f"wait_for_waypoints(count: {count})" for count in (1, 2)]
    faulty = scenario(waits[0], inject(part), waits[1], overrides=FAULTS[part][1])
    for folder in ("first", "second"):
        assert "the mission has ended" in run(faulty, f"{part}_{folder}").problem
    for name in ("trajectory.csv", "mission.csv"):
        first, second = (here / f"{part}_{each}" / name for each in ("first", "second"))
        assert first.read_bytes() == second.read_bytes()
    (row,) = pd.read_csv(here / f"{part}_first" / "mission.csv").to_dict("records")
    track = pd.read_csv(here / f"{part}_first" / "trajectory.csv")
    reached = float(track["time_s"][track["visited"] >= 1].iloc[0])
    assert row["failed_parts"] == part
    assert reached < row["parts_failed_at_s"] <= reached + 0.7 + 5.0 * (part == "battery")
    assert row["visited"] == 1


@pytest.mark.slow
def test_parts_fail_at_places_and_one_after_another(run: Callable[..., Ended], here: Path) -> None:
    """A failure that waits for a place, amid a mission whose sonars fail, too."""
    told = scenario(
        "wait elapsed(2s)",
        'inject_failure(failure: "drive", onset: "place", effect: "constant",'
        ' settings: "onset.x_m=1.0 onset.y_m=1.0 onset.radius_m=0.6")',
        'inject_fault(sensors: "0")',
        'wait_for_end(ended: "time_limit")',
        overrides=PART.replace("=120", "=40"),
    )
    ended = run(told, "placed")
    assert ended.passed, ended.lines
    (row,) = pd.read_csv(here / "placed" / "mission.csv").to_dict("records")
    track = pd.read_csv(here / "placed" / "trajectory.csv")
    near = np.hypot(track["x_m"] - 1.0, track["y_m"] - 1.0) <= 0.6
    assert (row["failed_parts"], row["failed_sensors"]) == ("drive", 0)
    assert row["parts_failed_at_s"] == pytest.approx(float(track["time_s"][near].iloc[0]))
    assert "inject_failure: constant of drive" in ended.lines


slow = partial(pytest.param, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (scenario("fly()"), 'unknown behavior "fly"'),
        ("nowhere.osc", "File does not exist"),
        (scenario("wait elapsed(3s)", overrides="world=mazze"), "world: must be one of"),
        (scenario("wait elapsed(3s)", overrides="world=maze"), "designs: must be a CSV file"),
        slow(
            scenario("wait elapsed(3s)", overrides=PART + " world=case_study"),
            "must be a single world",
        ),
        (scenario('inject_fault(sensors: "6")'), "must be all, numbers from 0 to 5"),
        slow(scenario('inject_fault(sensors: "all", effect: "hush")'), "filter: must be one of"),
        slow(scenario('inject_fault(sensors: "all", settings: "loud=1")'), "loud"),
        (scenario('inject_part_fault(part: "battery")'), "use inject_failure for another"),
        slow(scenario('inject_part_fault(part: "wheel", effect: "stuck")'), "strength of a wheel"),
        (scenario('inject_failure(failure: "drive", onset: "noon")'), "onset: must be one of"),
        (
            scenario('inject_failure(failure: "drive", onset: "place", settings: "onset.x_m=99")'),
            "failure.onset: must be in the world",
        ),
        slow(
            scenario('inject_part_fault(part: "drive")', "drive(speed: 0.1mps, duration: 2s)"),
            "must not affect commands, steering or drive",
        ),
        (
            scenario('wait_for_reading(channel: "colour")'),
            "channel: must be the start of a channel's name",
        ),
        (scenario('check_metric(metric: "beauty")'), "metric: must be a numeric column"),
    ],
)
def test_input_that_cannot_be_used_is_one_line_and_never_passes(
    run: Callable[..., Ended], text: str, line: str
) -> None:
    ended = run(text)
    assert not ended.passed
    told = [item for item in ended.lines if line in item.partition("\n")[0]]
    assert told, ended.lines
    assert not any("Traceback" in item for item in ended.lines)


def test_a_scenario_that_cannot_run_leaves_no_earlier_records(
    run: Callable[..., Ended], here: Path
) -> None:
    assert run(scenario("wait elapsed(1s)"), "again").passed
    assert (here / "again" / "mission.csv").exists()
    assert not run(scenario('inject_fault(sensors: "6")'), "again").passed
    assert [path.name for path in (here / "again").iterdir()] == ["test.xml"]


def test_a_step_that_does_not_fit_is_one_line(run: Callable[..., Ended]) -> None:
    odd = type("Odd", (Simulation,), {"dt": 0.25})
    assert (
        "dt: must be a multiple of the mission's tick (0.1 s)"
        in run(scenario("wait elapsed(1s)"), None, odd).lines[0]
    )


def test_a_quote_that_is_not_closed_is_one_line() -> None:
    assert split_words("overrides", "world=maze 'treatment.name=a b'")[1] == "treatment.name=a b"
    with pytest.raises(InputError, match="overrides: No closing quotation"):
        split_words("overrides", "world='maze")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "status"), [("mine/lost_sonars.osc", 1), ("mine/on_time.osc", 0)])
def test_a_process_ends_with_the_verdict(here: Path, name: str, status: int) -> None:
    tool = Path(sys.executable).with_name("scenario_execution")
    option = "evoros.plugins.openscenario:Simulation"
    ended = subprocess.run(
        [tool, name, "--simulation", option, "-o", name.removesuffix(".osc").replace("/", "_")],
        cwd=here,
        env=os.environ,
        capture_output=True,
        timeout=120,
    )
    assert ended.returncode == status, ended.stdout

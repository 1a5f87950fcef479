"""A program outside flies as the rover's own rules do, and its faults become what the page says."""

import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from busy import busy_cores
from executor_calls import wait_until
from fixture_types import Capture, Folders, Patch
from helpers import ROOT, content, start, wait_for_missions, with_parts

from evoros.base.errors import InputError, PilotLost, RunStopped
from evoros.bridge.pipes import Pipes
from evoros.cli.main import evoros
from evoros.config.compose import compose
from evoros.controller.line_controller import Program
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.executor.processes import Processes
from evoros.mission.mission import LOST, SIMULATION_FAILURE, Mission
from evoros.mission.plan import STOP, WORST
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.preflight.preflight import preflight
from evoros.testing import LiveControllerSuite

PROGRAMS = ROOT / "tests" / "programs"
FAULTY, RULES = PROGRAMS / "faulty.py", PROGRAMS / "rules.py"
LIMIT_S = 2.0
LAST = round(LIMIT_S / 0.1) - 1
EARLY = ("failure=random", "failure.earliest_s=1", "failure.latest_s=4")
MODES = ("avoiding", "navigating")
SILENT = ("stop", "silent")  # the faults that end at a limit of time


def mission(experiment: Experiment, place: float = 0.3, world: str = "maze") -> Mission:
    design = experiment.space.decode(np.linspace(place, 1.0 - place, experiment.space.size))
    return Mission(0, round(100 * place), design, world, 0, "selection", f"draws {place}")


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """Two seconds in the maze."""
    short = f"world.maze.course.time_limit_s={LIMIT_S}"
    return compose(["simulator=planar", "world=maze", short, "controller=rover_l1"]).build()


@pytest.fixture(autouse=True)
def _limits_begin_with_a_fault(monkeypatch: Patch) -> None:
    """On a slow machine, the limit of a silent program must not end its answers before."""
    send = Pipes.send

    def send_and_wait(pipes: Pipes, data: bytes) -> None:
        send(pipes, data)
        while not (pipes._readable.poll(5.0) or "words" in pipes.process.read_log()):
            pass
        pipes.begin(pipes._limit_s, pipes._time)

    monkeypatch.setattr(Pipes, "send", send_and_wait)


def faulty(experiment: Experiment, fault: str, tally: Path, **changes: Any) -> Scenario:
    """Only a program that shall not answer is given little time for it."""
    command = [sys.executable, "-I", "-S", str(FAULTY), fault, str(tally)]
    limit = 0.5 if fault.startswith(SILENT) else 60.0
    program = Program(command=command, **{"answer_limit_s": limit, **changes})
    return with_parts(experiment.scenario, controller=program)


# ---- conformance


class TestProgram(LiveControllerSuite):
    part = Program(command=[sys.executable, str(RULES)], modes=MODES)
    bad_values = ({"command": []}, {"modes": []}, {"answer_limit_s": 0.0})


@pytest.mark.slow
@pytest.mark.parametrize(("simulator", "limit_s"), [("planar", 40.0), ("pybullet", 6.0)])
def test_the_rover_s_own_rules_outside_give_its_trajectory(simulator: str, limit_s: float) -> None:
    limit = f"world.maze.course.time_limit_s={limit_s}"
    chosen = [f"simulator={simulator}", "world=maze", limit, *EARLY, "controller=rover_l1"]
    experiment = compose(chosen).build()
    inside = experiment.scenario
    outside = with_parts(
        inside,
        controller=Program(
            command=[sys.executable, str(RULES)],
            modes=MODES,
            localization=inside.members[0].controller.localization,
        ),
    )
    for place in (0.1, 0.4):
        expected, track = run_mission(inside, mission(experiment, place))
        outcomes, flown = run_mission(outside, mission(experiment, place))
        assert repr(outcomes) == repr(expected)
        assert flown.tobytes() == track.tobytes()
        assert np.isnan(track[:, -6:]).any(), "a sensor has failed"


# ---- runs


RUN = (
    "simulator=planar",
    "world=maze",
    "world.maze.course.time_limit_s=5",
    *EARLY,
    "optimizer.population_size=3",
    "optimizer.generations=2",
    "optimizer.validation_trials=1",
    "figures=[]",
)


def fly(folder: Path, controller: Sequence[str], *more: str) -> dict[str, str]:
    assert evoros([*RUN, f"hydra.run.dir={folder}", *controller, *more]) == 0
    return content(folder)


def command(*words: object) -> list[str]:
    listed = ",".join(f"'{word}'" for word in words)
    return [
        "controller=program",
        f"controller.command=[{listed}]",
        f"controller.modes=[{','.join(MODES)}]",
    ]


@pytest.fixture(scope="module")
def program(tmp_path_factory: Folders) -> list[str]:
    """The overrides for the Python program of the page."""
    path = tmp_path_factory.mktemp("a program") / "avoid.py"
    shutil.copy(ROOT / "docs" / "avoid.py", path)
    near = "+controller.parameters.near_m=1.0"
    return [*command(sys.executable, "-S", path), near]


@pytest.mark.slow
def test_a_run_with_the_rules_outside_gives_the_tables_of_one_with_them_inside(
    tmp_path: Path,
) -> None:
    few = ("optimizer.generations=1", "optimizer.population_size=2", "executor=serial")
    inside = fly(tmp_path / "inside", ["controller=rover_l1"], *few)
    localization = "controller/localization=autopilot_gps"
    outside = fly(tmp_path / "out", [*command(sys.executable, RULES), localization], *few)
    assert outside == inside
    assert any(name.startswith("champion/trajectory") for name in inside)


@pytest.mark.slow
def test_interruption_load_and_workers_change_no_byte(program: list[str], tmp_path: Path) -> None:
    alone = fly(tmp_path / "alone", program, "executor=serial")
    words = [*RUN, *program, "executor.workers=2", "controller.isolate=false"]
    words.append(f"hydra.run.dir={tmp_path / 'killed'}")
    with start(words, tmp_path) as killed:
        wait_for_missions(tmp_path / "killed", 1)
        with busy_cores():
            wait_for_missions(tmp_path / "killed", 2)
            killed.kill()
            killed.communicate()
    path = re.search(r"[^']*avoid.py", program[1])
    assert path
    assert wait_until(lambda: not list(find_processes(path[0])), 60.0)
    assert evoros(["resume", str(tmp_path / "killed"), "executor=serial"]) == 0
    assert content(tmp_path / "killed") == alone


def find_processes(word: str) -> Iterator[int]:
    """The processes whose command contains a text."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended
            if word.encode() in path.read_bytes():
                yield int(path.parent.name)


# ---- faults


ENDS = {
    "exit": "ended with exit status 3",
    "kill": r"ended by signal 9 \(Killed\)",
    "stop": "did not answer within 0.5 s",
    "silent": "did not answer within 0.5 s",
    "close": "closed its (in|out)put",
}
WORDS = "; its last output: these are the last words$"


@pytest.mark.parametrize("tick", [0, LAST])
@pytest.mark.parametrize("fault", ENDS)
def test_a_lost_program_is_told_with_time_status_and_last_words(
    experiment: Experiment, fault: str, tick: int, tmp_path: Path
) -> None:
    scenario = faulty(experiment, f"{fault}@{tick}", tmp_path / "tally")
    what = rf"^python\S* {ENDS[fault]} at {tick / 10:g} simulated s{WORDS}"
    with pytest.raises(PilotLost, match=what) as caught:
        run_mission(scenario, mission(experiment))
    assert caught.value.log == "these are the\nlast words\n"


ANSWERS = {
    "rubbish": "sent 'what[?]' at {} s; it must send .mode, speed, steering. with a mode",
    "nan": "sent '.1, NaN, 0.0.' at {} s",
    "infinity": "sent '.1, 0.2, Infinity.' at {} s",
    "mode": "sent '.9, 0.2, 0.0.' at {} s",
    "short": "sent '.1.' at {} s",
    "two": "replied with more than one line at {} s; it must reply to each line with one",
    "flood": "sent 1048576 bytes without a newline at {} s",
}


@pytest.mark.parametrize("tick", [0, LAST])
@pytest.mark.parametrize("fault", ANSWERS)
def test_an_unusable_answer_is_a_failure_with_its_time(
    experiment: Experiment, fault: str, tick: int, tmp_path: Path
) -> None:
    scenario = faulty(experiment, f"{fault}@{tick}", tmp_path / "tally")
    (outcome,), track = run_mission(scenario, mission(experiment))
    assert (outcome.ended, len(track)) == (SIMULATION_FAILURE, 0)
    assert re.search(ANSWERS[fault].format(f"{tick / 10:g}"), outcome.reason)


STARTS = {
    **{fault: f"{what} before the mission started{WORDS}" for fault, what in ENDS.items()},
    "refuse": "refuses the mission: no wheels$",
    "rubbish": "the first line must be .*, not 'what[?]'; correct the program$",
    "nan": "the first line must be ",
    "two": "replied with more than one line; it must",
    "flood": "sent 1048576 bytes without a newline; it must",
}


@pytest.mark.parametrize("fault", STARTS)
def test_a_fault_at_the_start_is_one_line_before_the_run(
    experiment: Experiment, fault: str, tmp_path: Path
) -> None:
    limit = 0.5 if fault in SILENT else 60.0
    scenario = faulty(experiment, f"{fault}@start", tmp_path / "tally", start_limit_s=limit)
    with pytest.raises(InputError, match=rf"^controller: python\S*:? {STARTS[fault]}") as caught:
        preflight(replace(experiment, controller=scenario.members[0].controller))
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_lost_mission_is_flown_as_often_as_the_executor_says(
    experiment: Experiment, tmp_path: Path
) -> None:
    scenario = faulty(experiment, "kill@5", tmp_path / "tally")
    missions = [mission(experiment, place) for place in (0.1, 0.2, 0.3, 0.4)]
    logs = {}
    with Processes(workers=1, retries=2).open() as pool:
        worst = Dispatcher(pool, WORST, lambda lost, log: logs.update({lost.key: log}))
        results = [result for results in worst.run(scenario, missions) for result in results]
        assert (tmp_path / "tally").read_text().count("started") == 3 * len(missions)
        assert {lost.key: "these are the\nlast words\n" for lost in missions} == logs
        reason = r"ended by signal 9 \(Killed\) at 0.5 simulated s; its last output"
        for _, (outcome,) in results:
            assert outcome.ended == LOST
            assert re.search(reason, outcome.reason)
        stop = Dispatcher(pool, STOP)
        where = r"^the mission of design 10 in maze, generation 0, trial 0: python"
        with pytest.raises(RunStopped, match=where + rf"\S* {reason}"):
            list(stop.run(scenario, missions[:1]))


@pytest.mark.slow
def test_a_run_keeps_what_a_lost_program_printed(tmp_path: Path) -> None:
    words = (sys.executable, "-I", "-S", FAULTY, "exit@30", tmp_path / "tally")
    few = ("optimizer.generations=1", "optimizer.population_size=2", "executor=serial")
    fly(tmp_path / "run", command(*words), *few, "lost_missions=worst")
    kept = {file.name: file.read_text() for file in (tmp_path / "run" / "lost").iterdir()}
    assert {"00000_0_maze_0.log", "00000_1_maze_0.log"} <= set(kept)
    assert set(kept.values()) == {"these are the\nlast words\n"}
    rows = (tmp_path / "run" / "missions.csv").read_text()
    assert "exit status 3 at 3 simulated s" in rows


@pytest.mark.slow
def test_a_refusal_amid_a_run_stops_it_and_is_never_a_refused_design(
    tmp_path: Path, capfd: Capture
) -> None:
    gate = tmp_path / "gate.sh"  # refuses from the fifth start on
    gate.write_text(
        f"#!/bin/sh\n[ $(grep -c started {tmp_path}/tally) -ge 4 ] && fault=refuse@start\n"
        f'exec "{sys.executable}" -I -S "{FAULTY}" "${{fault:-none}}" {tmp_path}/tally\n'
    )
    gate.chmod(0o755)
    words = [*RUN, *command(gate), "executor=serial"]
    gene = "_target_: evoros.design.genes.Gene, key: controller.parameters.until_s, low: 1, high: 2"
    genes = ["+controller.parameters.until_s=1.0", f"+design.genes.until={{{gene}}}"]
    (tmp_path / "tally").touch()
    status = evoros([*words, *genes, f"hydra.run.dir={tmp_path / 'run'}"])
    assert status == 2
    (line,) = (line for line in capfd.readouterr().err.splitlines() if "refuses" in line)
    assert re.fullmatch(
        r"evoros: the mission of design \d+ in maze, generation 0, trial 0: gate.sh refuses the "
        r"mission: no wheels",
        line,
    )
    assert "refused" not in (tmp_path / "run" / "missions.csv").read_text()


def test_a_robot_without_commands_stops_after_its_time(
    experiment: Experiment, tmp_path: Path
) -> None:
    def speeds(**changes: Any) -> Any:
        parameters = {"until_s": 1.0}
        scenario = faulty(experiment, "none", tmp_path / "tally", parameters=parameters, **changes)
        return run_mission(scenario, mission(experiment))[1][:, 4]

    stopping, going = speeds(command_timeout_s=0.3), speeds()
    np.testing.assert_array_equal(stopping[:12], going[:12])
    assert going[-1] == pytest.approx(0.2, abs=0.01)
    assert abs(stopping[-1]) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("isolate", [True, False])
def test_nothing_remains_of_lost_missions(
    experiment: Experiment, tmp_path: Path, isolate: bool, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    for fault in ("stop@3", "close@3", "exit@3"):
        scenario = faulty(experiment, fault, tmp_path / "tally", isolate=isolate)
        with pytest.raises(PilotLost):
            run_mission(scenario, mission(experiment))
    assert not list((tmp_path / "temporary").iterdir())
    assert not list(find_processes(str(tmp_path)))


# ---- input


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("controller.command=[]", "controller.command: must be a command, as a list"),
        (
            "controller.modes=[a,a]",
            "controller.modes: must be a non-empty list of distinct strings",
        ),
        ("controller.period_s=0.033", "controller.period_s: must be "),
        ("+controller.parameters.x=nan", "controller.parameters: must be a mapping from names to"),
        (
            "+controller.environment.A=1",
            "controller.environment: must be a mapping from names to strings",
        ),
        ("controller.files=[no/such]", "no/such: cannot be read (No such file or directory)"),
    ],
)
def test_bad_input_is_one_line_before_the_run(
    override: str, message: str, tmp_path: Path, capfd: Capture
) -> None:
    working = (sys.executable, "-I", "-S", FAULTY, "none", tmp_path / "tally")
    words = [*RUN, *command(*working), "executor=serial", f"hydra.run.dir={tmp_path / 'run'}"]
    assert evoros([*words, override]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert message in line
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_program_in_the_confirmation_is_started_before_the_run(
    tmp_path: Path, capfd: Capture
) -> None:
    confirmed = ("confirmation=physics", "simulator@confirmation.simulator=planar")
    other = "+controller@confirmation.controller=program"
    words = [*RUN, *confirmed, other, f"confirmation.controller.command={tmp_path / 'none'}"]
    assert evoros([*words, f"hydra.run.dir={tmp_path / 'run'}"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"evoros: confirmation.controller: {tmp_path / 'none'}: cannot be exec")


def test_files_of_the_current_folder_are_found_in_an_empty_one(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "a b.txt"):
        (tmp_path / name).touch()
    told = Program(command="mine.py 'a b.txt' word none.txt ./none", files=["mine.py"])
    assert told.command == [
        f"{tmp_path}/mine.py",
        f"{tmp_path}/a b.txt",
        "word",
        "none.txt",
        "./none",
    ]
    assert told.files == (f"{tmp_path}/mine.py", f"{tmp_path}/a b.txt")
    assert replace(told, period_s=0.2).files == told.files


@pytest.mark.slow
def test_a_program_that_has_changed_stops_a_resume(tmp_path: Path, capfd: Capture) -> None:
    path = tmp_path / "mine.py"
    path.write_text(FAULTY.read_text())
    few = ("optimizer.generations=1", "optimizer.population_size=2", "executor=serial")
    fly(tmp_path / "run", command(sys.executable, "-S", path, "none", tmp_path / "tally"), *few)
    path.write_text(FAULTY.read_text() + "\n")
    capfd.readouterr()
    assert evoros(["resume", str(tmp_path / "run")]) == 2
    assert f"file {path} has changed since the run began" in capfd.readouterr().err

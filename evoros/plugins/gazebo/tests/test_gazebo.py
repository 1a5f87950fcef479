"""Gazebo's server: equal bits however it is used, and one line for each of its faults."""

import json
import os
import pickle
import re
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from executor_calls import wait_until
from fixture_types import Patch
from helpers import content, start, wait_for_missions
from planar_cases import experiment as plane_experiment
from planar_cases import world_of
from proposal_sites import is_of
from pybullet_cases import LIMITS, beam, box, going_on, level, mission, mount_sensors
from team_cases import drive, equip, facing

from evoros.base.arrays import CONTACT, STATE_SIZE
from evoros.base.errors import InputError, LaunchError, PilotLost, SimulationError
from evoros.cli.main import evoros
from evoros.config.compose import compose
from evoros.dispatch.dispatcher import Dispatcher
from evoros.drive.protocol import Drive
from evoros.evolution.experiment import Experiment
from evoros.executor.processes import Processes
from evoros.formats.urdf.tree import UrdfDocument
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import LOST
from evoros.mission.plan import WORST
from evoros.mission.rollout import run_mission
from evoros.plugins.gazebo import server as gazebo_server
from evoros.plugins.gazebo import simulator as gazebo
from evoros.plugins.gazebo.gazebo_world import hold_standing
from evoros.plugins.gazebo.server import compile_server, find_library
from evoros.plugins.gazebo.simulator import MOST_MOVABLE, Gazebo
from evoros.plugins.gazebo.tests.gazebo_cases import (
    find_servers,
    list_ports,
    own_cache,
    replace_server,
    write_program,
)
from evoros.robot.model import Robot
from evoros.sensor.bumper import Bumper
from evoros.sensor.imu import Imu
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

pytestmark = [pytest.mark.gz_physics, pytest.mark.usefixtures("own_engines")]


@pytest.fixture(scope="module")
def flown() -> Experiment:
    """Missions of eight seconds in Gazebo."""
    return compose(["failure=random", "simulator=gazebo", *LIMITS]).build()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: Patch) -> Iterator[Path]:
    """A cache for scripts in place of the server, which workers use, too."""
    compile_server()
    own_cache(tmp_path)
    yield tmp_path
    gazebo.IDLE.close()


def push() -> bytes:
    """The bits of a rover that pushes boxes and polyhedra, with sensors of each kind."""
    corners = tuple((x, y, z) for x in (-0.1, 0.12) for y in (-0.1, 0.1) for z in (0.0, 0.3))
    stone = Body("stone", Pose((1.0, 0.3, 0.0)), (Shape("convex", (), corners=corners),))
    loose = Body("loose", Pose((0.6, 0.1, 0.0)), (Shape("convex", (), corners=corners),), 1.0)
    robot = equip("erle_rover", (0.2, 0.0, 0.1, 0.0), imu=(Imu(), (0.0, 0.0, 0.2, 0.0)),
                  bumper=(Bumper(), (0.25, 0.0, 0.1, 0.0)))  # fmt: skip
    world = going_on(world_of())
    crates = [box(f"crate{i}", 1.2 + 0.5 * i, 0.1 * i, (0.3, 0.3, 0.3), 0.5) for i in range(3)]
    world = replace(world, bodies=(*world.bodies, stone, loose, *crates))
    robots = facing(robot, robot, 3.0)
    states, signals = drive(Gazebo(), robots, world, [(0.3, 0.1), (0.25, -0.05)], 60)
    assert (states[-1, :, CONTACT] > 0.0).any()
    return states.tobytes() + signals.tobytes()


# ---- determinism


@pytest.mark.slow
def test_bits_do_not_depend_on_what_a_server_did_before(flown: Experiment) -> None:
    first = push()
    assert push() == first
    run_mission(flown.scenario, mission(flown, "maze"))
    assert push() == first
    gazebo.IDLE.forget()
    assert push() == first
    gazebo.IDLE.close()
    assert push() == first


@pytest.mark.slow
def test_workers_fly_the_bits_of_this_process(flown: Experiment) -> None:
    missions = [mission(flown, world, 3) for world in flown.world] * 2
    expected = [repr(run_mission(flown.scenario, each)[0]) for each in missions]
    with Processes(workers=2).open() as pool:
        done = dict(_fly(flown, pool, missions))
    assert [done[each.key] for each in missions] == expected[: len(missions)]
    assert wait_until(lambda: len(list(find_servers())) <= 1), "this process's own remains"


def _fly(flown: Experiment, pool: Any, missions: list[Any]) -> Iterator[tuple[Any, str]]:
    dispatcher = Dispatcher(pool, WORST, lambda *_: None)
    for results in dispatcher.run(flown.scenario, missions):
        for each, outcomes in results:
            yield each.key, repr(outcomes)


@pytest.mark.slow
def test_a_run_that_is_killed_and_resumed_has_the_bytes_of_one_that_is_not(tmp_path: Path) -> None:
    words = [
        *("simulator=gazebo", "world=maze", "world.maze.course.time_limit_s=5", "figures=[]"),
        *("optimizer.population_size=3", "optimizer.generations=2"),
        *("optimizer.validation_trials=1", "failure=random", "failure.earliest_s=1"),
        *("failure.latest_s=4", "confirmation=gazebo", "record=all"),
    ]
    alone, killed = tmp_path / "alone", tmp_path / "killed"
    assert evoros([*words, "executor=serial", f"hydra.run.dir={alone}"]) == 0
    gazebo.IDLE.close()
    with start([*words, "executor.workers=2", f"hydra.run.dir={killed}"], tmp_path) as run:
        wait_for_missions(killed, 2)
        run.kill()
        run.communicate()
    assert wait_until(lambda: not list(find_servers()), 60.0)
    assert evoros(["resume", str(killed), "executor=serial"]) == 0
    assert content(killed) == content(alone)
    recorded = json.loads((killed / "manifest.json").read_text())["programs"]
    assert recorded == dict(find_library().versions)


@pytest.mark.parametrize("step", [0.001, 0.004])
def test_finer_steps_are_possible(step: float) -> None:
    state = np.zeros(STATE_SIZE)
    with open_alone(
        Gazebo(time_step=step).open, plane_experiment().robot, level(plane_experiment())
    ) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 2.0)
        simulation.observe(state)
    assert state[0] == pytest.approx(0.6, abs=0.01)


# ---- the process beside this one


def test_the_server_listens_nowhere_and_ends_with_its_engine(flown: Experiment) -> None:
    gazebo.IDLE.close()
    assert not list(find_servers())
    run_mission(flown.scenario, mission(flown, "maze"))
    (server,) = find_servers()
    assert list_ports(server) == []
    gazebo.IDLE.close()
    assert not list(find_servers())


def drive_and_send(number: int, robot: Robot, world: World, **settings: float) -> None:
    """Drive for 0.5 s, send the server a signal, and drive on."""
    with open_alone(Gazebo().open, robot, world) as simulation:
        simulation.advance(np.zeros(2), 0.1)
    with open_alone(Gazebo(**settings).open, robot, world) as simulation:
        simulation.advance(np.zeros(2), 0.5)
        (server,) = find_servers()
        os.kill(server, number)
        simulation.advance(np.zeros(2), 0.5)


def test_a_killed_server_is_lost_with_its_time_and_the_next_one_flies_the_same(
    flown: Experiment,
) -> None:
    robot, world = plane_experiment().robot, level(plane_experiment())
    expected = repr(run_mission(flown.scenario, mission(flown, "maze")))
    what = r"^gazebo_server-\w+ ended by signal 9 \(Killed\) at 0.5 simulated s; it printed nothing"
    with pytest.raises(PilotLost, match=what):
        drive_and_send(signal.SIGKILL, robot, world)
    assert not list(find_servers())
    assert repr(run_mission(flown.scenario, mission(flown, "maze"))) == expected


def test_a_server_that_hangs_is_lost_at_the_limit() -> None:
    robot, world = plane_experiment().robot, level(plane_experiment())
    with pytest.raises(PilotLost, match=r"did not answer within 3 s at 0\.5 simulated s"):
        drive_and_send(signal.SIGSTOP, robot, world, answer_limit_s=3.0)
    assert not list(find_servers())


@pytest.mark.slow
def test_a_mission_whose_server_ends_is_flown_again(
    flown: Experiment, cache: Path, monkeypatch: Patch
) -> None:
    """At the second attempt it has the outcome that it has anyway; without one it is lost."""
    expected = repr(run_mission(flown.scenario, mission(flown, "maze"))[0])
    gazebo.IDLE.close()
    tally = cache / "tally"
    once = f"echo started >> {tally}; [ $(wc -l < {tally}) -gt 1 ] && exec {{server}}; kill -9 $$"
    replace_server(cache, once)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    with Processes(workers=1, retries=1).open() as pool:
        ((_, outcomes),) = _fly(flown, pool, [mission(flown, "maze")])
    assert outcomes == expected
    monkeypatch.delenv("XDG_CACHE_HOME")
    replace_server(cache, "echo these are the last words; exit 3")
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    with Processes(workers=1, retries=1).open() as pool:
        dispatcher = Dispatcher(pool, WORST, lambda *_: None)
        (((_, (lost,)),),) = dispatcher.run(flown.scenario, [mission(flown, "maze")])
    assert lost.ended == LOST
    assert "exit status 3 before the mission started; its last output: these are the" in lost.reason
    assert not list(find_servers())


def test_what_libraries_print_changes_no_bit(
    flown: Experiment, cache: Path, monkeypatch: Patch, capfd: Any
) -> None:
    expected = repr(run_mission(flown.scenario, mission(flown, "maze")))
    gazebo.IDLE.close()
    noise = "(while echo noise; do sleep 0.01; done) & head -c 300000 /dev/zero >&2; exec {server}"
    replace_server(cache, noise)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    assert repr(run_mission(flown.scenario, mission(flown, "maze"))) == expected
    assert "noise" not in "".join(capfd.readouterr())


# ---- worlds and robots


@pytest.mark.slow
def test_many_obstacles_are_possible_and_many_movable_ones_refused() -> None:
    """2,000 of them: half are polyhedra."""
    corners = tuple((x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (0.0, 0.3))
    shapes = (Shape("convex", (), corners=corners), Shape("box", (0.3, 0.3, 0.3)))
    bodies = [
        Body(f"b{i}", Pose((12.0 + i // 50, i % 50 - 25.2, 0.15 * (i % 2))), (shapes[i % 2],))
        for i in range(2000)
    ]
    world, state = level(plane_experiment(), *bodies), np.zeros(STATE_SIZE)
    robot = mount_sensors(plane_experiment(), beam(), (0.2, 0.0, 0.15, 0.0, 0.0))
    with open_alone(Gazebo(time_step=0.02).open, robot, world) as simulation:
        simulation.advance(np.array([0.3, 0.0]), 1.0)
        simulation.observe(state)
    assert state[0] == pytest.approx(0.3, abs=0.01)
    loose = going_on(level(plane_experiment(), *(replace(b, mass=1.0) for b in bodies)))
    with pytest.raises(
        InputError, match=f"at most {MOST_MOVABLE} movable bodies .* not 2000"
    ) as refused:
        Gazebo().check_world(loose)
    assert is_of(str(refused.value), "evoros/plugins/gazebo/simulator.py simulator=gazebo")
    Mujoco().check_world(loose)
    Gazebo().check_world(replace(loose, course=replace(loose.course, end_on_collision=True)))


def test_what_gazebo_refuses_is_one_line_and_the_server_goes_on(flown: Experiment) -> None:
    robot = plane_experiment().robot
    text = re.sub('ixx="[^"]*"', 'ixx="100"', robot.engine_text, count=1)  # more than iyy + izz
    heavy = replace(robot, engine_urdf=UrdfDocument(text))
    world = level(plane_experiment())
    with (
        pytest.raises(SimulationError, match=r"^erle_rover in the world 'boxes': Gazebo: ") as told,
        open_alone(Gazebo().open, heavy, world),
    ):
        pass
    assert "\n" not in str(told.value)
    assert is_of(str(told.value), "evoros/plugins/gazebo/server.py simulator=pybullet")
    for simulator in (PyBullet(), Planar()):
        with open_alone(simulator.open, heavy, world):
            pass
    run_mission(flown.scenario, mission(flown, "maze"))


def test_standing_bodies_are_held_only_while_nothing_can_move_them() -> None:
    """In missions that end at the first contact, of one robot; a body in the air falls."""
    world = level(plane_experiment(), box("a", 3.0, mass=1.0), replace(box("b", 6.0), mass=1.0))
    lifted = replace(world.bodies[-1], pose=Pose((6.0, 0.0, 1.5)))
    world = replace(world, bodies=(*world.bodies[:-1], lifted))
    held = hold_standing(world, 1)
    assert [body.mass for body in held.bodies[-2:]] == [None, 1.0]
    assert hold_standing(world, 2) == world
    assert hold_standing(going_on(world), 1) == going_on(world)


def test_a_worker_with_another_release_is_refused_in_one_line(
    flown: Experiment, monkeypatch: Patch
) -> None:
    """A simulator remembers where it was made, as a pickle that another machine gets."""
    library = find_library()
    versions = {name: f"{version}.1" for name, version in library.versions.items()}
    sent = pickle.dumps(Gazebo())
    monkeypatch.setattr(gazebo, "find_library", lambda: library._replace(versions=versions))
    scenario = replace(flown.scenario, simulator=pickle.loads(sent))
    with pytest.raises(LaunchError, match=r"a worker has .*, but the main process has"):
        run_mission(scenario, mission(flown, "maze"))


def test_skid_steer_is_doubted_and_nothing_else() -> None:
    for name, doubted in (("mule", True), ("courier", False), ("erle_rover", False)):
        robot_drive: Drive = equip(name).drive
        assert bool(Gazebo().doubt_drive(robot_drive)) == doubted


# ---- the compiler and the library


@pytest.fixture
def fresh_library() -> Iterator[None]:
    """Find the library anew, in this test and after it."""
    find_library.cache_clear()
    yield
    find_library.cache_clear()


@pytest.mark.usefixtures("fresh_library")
@pytest.mark.parametrize(
    ("programs", "what"),
    [
        ({}, "program pkg-config not found"),
        ({"pkg-config": "exit 1"}, r"program g\+\+ not found"),
        ({"pkg-config": "exit 1", "g++": "exit 1"}, "pkg-config found none of gz-physics"),
        ({"pkg-config": "[ $1 = --exists ] || { echo no sdf >&2; exit 1; }", "g++": ""}, "no sdf"),
    ],
)
def test_a_lack_is_one_line_with_the_packages(
    programs: dict[str, str], what: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    (tmp_path / "bin").mkdir()
    for name, script in programs.items():
        write_program(tmp_path / "bin", name, script)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    expected = rf"simulator=gazebo: .*{what}.*libignition-physics-core-dev"
    with pytest.raises(InputError, match=expected) as told:
        Gazebo()
    assert "\n" not in str(told.value)


@pytest.mark.usefixtures("fresh_library")
def test_each_version_is_compiled_once_by_whichever_process_is_first(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    """Four ask at once; another version, or another source, is compiled for itself."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    script = f'echo run >> {tmp_path}/tally; sleep 0.3; shift 3; touch "$1"'
    write_program(tmp_path / "bin", "g++", script)
    write_program(
        tmp_path / "bin",
        "pkg-config",
        f"[ $1 = --modversion ] && exec cat {tmp_path}/version; echo -lgz",
    )
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:{os.environ['PATH']}")
    (tmp_path / "version").write_text("5.1.0")
    with ThreadPoolExecutor(4) as threads:
        servers = {task.result() for task in [threads.submit(compile_server) for _ in range(4)]}
    assert len(servers) == 1
    assert (tmp_path / "tally").read_text().count("run") == 1
    (tmp_path / "version").write_text("5.4.0")
    find_library.cache_clear()
    servers.add(compile_server())
    source = tmp_path / "gazebo_server.cc"
    source.write_text("int main() {}")
    monkeypatch.setattr(gazebo_server, "SOURCE", source)
    servers.add(compile_server())
    assert len(servers) == 3
    assert Gazebo().versions["gz-physics"] == "5.4.0"


@pytest.mark.usefixtures("fresh_library")
def test_a_source_that_does_not_compile_is_one_line(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    source = tmp_path / "gazebo_server.cc"
    source.write_text('#error "another library"\n')
    monkeypatch.setattr(gazebo_server, "SOURCE", source)
    expected = r"does not compile with .* \(.*#error .another library.\); install with `apt-get"
    with pytest.raises(InputError, match=expected) as told:
        compile_server()
    assert "\n" not in str(told.value)
    assert is_of(str(told.value), "evoros/plugins/gazebo/server.py simulator=mujoco")
    assert isinstance(compose(["simulator=mujoco"]).build().simulator, Mujoco)
    assert [path.name for path in (tmp_path / "evoros" / "gazebo").iterdir()] == ["lock"]

"""Compiled missions: the bits of interpreted ones, whatever the parts; kept on disk."""

import configparser
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers import ROOT
from mission_cases import COMBINATIONS, experiment_of, missions, run_interpreted, same, watch
from numpy.random import Generator

from evoros.base.arrays import NO_VALUES, Array
from evoros.base.errors import InputError, PartFault
from evoros.base.rng import generator
from evoros.compilation import machine_code
from evoros.compilation.named_rules import NamedRule, Started
from evoros.compilation.rules import FILTER, CompiledRule, NotCompilable, compile_rule
from evoros.controller.protocol import Estimator, Layer
from evoros.evolution.experiment import Experiment
from evoros.files.resources import PACKAGE
from evoros.filter.protocol import FILTER_ARGUMENTS, Channels, Filter
from evoros.mission.compiled_loop import compile_loop
from evoros.mission.loop import run_loop
from evoros.mission.rollout import run_mission
from evoros.preflight.preflight import preflight
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_rules import advance, observe
from evoros.simulator.engines.planar_sensing import sense
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, RuleSimulation, SimulationRules
from evoros.world.model import World


@pytest.mark.parametrize("overrides", COMBINATIONS, ids=lambda names: names[0] + str(len(names)))
def test_the_compiled_mission_is_the_interpreted_one(overrides: list[str]) -> None:
    experiment = experiment_of(*overrides)
    for mission in missions(experiment, 1):
        whole = run_mission(experiment.scenario, mission)
        stepped = run_mission(experiment.scenario, mission, run_interpreted)
        assert same(whole, stepped)


def test_one_compiled_loop_serves_any_number_of_robots_and_filters() -> None:
    before = compile_loop()
    late = [f"+filter@design.sensors.sonar.filters.f{i}=gaussian_noise" for i in range(40)]
    for overrides in ([], ["agents=oncoming", *late]):
        experiment = experiment_of(*overrides, "course.time_limit_s=3")
        mission = missions(experiment, 1)[0]
        whole = run_mission(experiment.scenario, mission)
        assert same(whole, run_mission(experiment.scenario, mission, run_interpreted))
    assert compile_loop() is before
    assert compile_loop.cache_info().currsize == 1


@pytest.mark.slow
def test_bodies_of_all_kinds_and_bumps_are_compiled_alike() -> None:
    """In a generated field, driven blindly, where a collision does not end the mission."""
    experiment = experiment_of(
        "world=generated",
        "world.generated.density=0.2",
        "world.generated.gap_m=0.3",
        "controller/avoidance=blind",
        "course.end_on_collision=false",
        "course.time_limit_s=60",
    )
    bumps = 0
    for mission in missions(experiment, 2):
        whole = run_mission(experiment.scenario, mission)
        bumps += whole[0][0].collisions
        assert same(whole, run_mission(experiment.scenario, mission, run_interpreted))
    assert bumps > 0


def test_bundled_parts_are_compiled_from_start_to_end() -> None:
    seen: list[Any] = []
    for overrides in COMBINATIONS:
        experiment = experiment_of(*overrides)
        run_mission(experiment.scenario, missions(experiment, 1)[0], watch(seen))
    loops = [loop for loop, _ in seen]
    assert run_loop not in loops
    for _, parts in seen:
        stages = (*parts.filters, *parts.localization, *parts.actuation, *parts.layers)
        rules = (*parts[:3], *(stage.rule for stage in stages))
        assert all(rule.borrows for rule in rules)  # they count no references to arrays


class Memory(NamedTuple):
    before: Array


@dataclass(frozen=True)
class Smooth(Filter):
    """A user's filter: the mean of the value and the one before, by a rule of some kind."""

    rule: Callable[..., None]
    name = "Smooth"

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return None, Memory(np.full(channels.size, math.nan))


def smooth(memory: Memory, values: Array) -> None:
    for i in range(len(values)):
        new = values[i]
        if not math.isnan(memory.before[i]):
            values[i] = 0.5 * (new + memory.before[i])
        memory.before[i] = new


def smooth_in_python(memory: Memory, values: Array) -> None:
    """``smooth`` with a call that numba does not know."""
    kept = {"i": sys.maxsize}
    for kept["i"] in range(len(values)):
        new = values[kept["i"]]
        if not math.isnan(memory.before[kept["i"]]):
            values[kept["i"]] = 0.5 * (new + memory.before[kept["i"]])
        memory.before[kept["i"]] = new
    assert list(map(str, sorted(kept))) == ["i"]


class Live:
    """An object whose method is a rule."""

    def smooth(self, values: Array, memory: Memory) -> None:
        smooth(memory, values)


class Called:
    """An object that is called: it has no name of its own, and no hash."""

    __hash__ = None  # type: ignore[assignment]

    def __call__(self, memory: Memory, values: Array) -> None:
        smooth(memory, values)


def with_filter(rule: Callable[..., None], kind: type[Smooth] = Smooth) -> Experiment:
    experiment = experiment_of()
    sonar = experiment.design.sensors["sonar"]
    filters = {**sonar.filters, "smooth": kind(rule)}
    sensors = {"sonar": replace(sonar, filters=filters)}  # type: ignore[type-var]
    return replace(experiment, design=replace(experiment.design, sensors=sensors))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rule", "name"),
    [
        (smooth_in_python, f"{__name__}.smooth_in_python"),
        (Live().smooth, f"{__name__}.Live.smooth"),
        (Called(), f"{__name__}.Called"),
        (partial(smooth), "functools.partial"),
    ],
    ids=["python", "method", "object", "partial"],
)
def test_a_plain_python_rule_works_and_is_named(
    rule: Callable[..., None], name: str, caplog: pytest.LogCaptureFixture
) -> None:
    """It gives the bits of the same rule compiled, and a line says that it is slower."""
    compilable, interpreted = with_filter(smooth), with_filter(rule)
    preflight(compilable)
    assert "not compiled" not in caplog.text
    preflight(interpreted)
    (line,) = [r.getMessage() for r in caplog.records if "not compiled" in r.getMessage()]
    assert line.startswith(f"{name} is not compiled: ")
    assert "slower" in line
    for mission in missions(compilable, 1):
        seen: list[Any] = []
        one = run_mission(compilable.scenario, mission, watch(seen))
        other = run_mission(interpreted.scenario, mission, watch(seen))
        assert same(one, other)
        assert seen[0][0] is not run_loop
        assert seen[1][0] is run_loop


def before_and_after(memory: Memory, values: Array) -> None:
    values[0] = memory.after[0]  # type: ignore[attr-defined]


def with_state(state: Array) -> None:
    pass


@dataclass(frozen=True)
class Forgetful(Smooth):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return None


@dataclass(frozen=True)
class Listed(Smooth):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return [0.0] * 6  # type: ignore[return-value]


@dataclass(frozen=True)
class Flat(Smooth):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return None, Memory(np.zeros((2, 3)))


@dataclass(frozen=True)
class Short(Smooth):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        return None, Memory()  # type: ignore[call-arg]


@dataclass(frozen=True)
class Vague(Smooth):
    effect = "worsens"


@pytest.mark.parametrize(
    ("rule", "kind", "message"),
    [
        (
            with_state,
            Smooth,
            "with_state: must take only the arguments parameters, .* time, not state",
        ),
        (smooth, Forgetful, r"smooth: has the argument memory, which start\(\) does not return"),
        (smooth, Listed, r"Listed\.start must return named tuples.*\[0"),
        (
            smooth,
            Short,
            r"Short\.start: Memory must have .* field \(missing .* 'before'\); correct",
        ),
        (smooth, Flat, r"Memory\.before: must be a one-dimensional array of float64"),
        (smooth, Vague, r"Vague\.effect: must be one of ends, alters, grows, not 'worsens'"),
    ],
)
def test_a_wrong_rule_is_refused_in_one_line(
    rule: Callable[..., None], kind: type[Smooth], message: str
) -> None:
    with pytest.raises(InputError, match=message) as error:
        preflight(with_filter(rule, kind))
    assert "\n" not in str(error.value)


def test_a_misspelt_field_is_named_before_the_run() -> None:
    with pytest.raises(
        PartFault, match=r"before_and_after: .*'Memory' .* attribute 'after'; correct "
    ):
        preflight(with_filter(before_and_after, Smooth))


class Lost(NamedTuple):
    pose: Array
    speed: float


@dataclass(frozen=True)
class Careless(Layer, Estimator):
    """A layer and an estimator, whose starts leave out a field."""

    mode = "avoiding"

    def start(self, robot: Robot, period: float, rng: Generator) -> Started:
        return Lost(speed=1.0)  # type: ignore[call-arg]

    def start_estimate(self, robot: Robot, period: float) -> Started:
        return Lost(np.zeros(2))  # type: ignore[call-arg]

    @staticmethod
    def rule() -> bool:  # type: ignore[override]
        return False


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"avoidance": Careless()}, r"Careless\.start: Lost must .* \(missing .* 'pose'\)"),
        (
            {"localization": {"own": Careless()}},
            r"Careless\.start_estimate: Lost must .* \(missing .* 'speed'\)",
        ),
    ],
    ids=["layer", "localization"],
)
def test_a_start_that_leaves_out_a_field_is_refused_in_one_line(
    changes: dict[str, Any], message: str
) -> None:
    experiment = experiment_of()
    controller = replace(experiment.controller, **changes)  # type: ignore[type-var]
    with pytest.raises(InputError, match=message) as error:
        preflight(replace(experiment, controller=controller))
    assert "\n" not in str(error.value)


class CarelessSimulator(Planar):
    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[RuleSimulation]:
        rules = SimulationRules(observe, sense, advance)
        yield RuleSimulation(rules, np.zeros(3), np.zeros(3, dtype=np.int64))


def test_so_are_those_of_a_simulation() -> None:
    experiment = experiment_of()
    scenario = replace(experiment.scenario, simulator=CarelessSimulator())
    with pytest.raises(InputError, match=r"planar_rules\.advance: its memory must be a contiguous"):
        run_mission(scenario, missions(experiment, 1)[0])


def divide(values: Array, time: float) -> None:
    """Infinite, NaN, and then what was reached only if nothing was raised."""
    values[0] = values[3] / (time - time)
    values[1] = (time - time) / (time - time)
    values[2] = values[3]


@pytest.mark.slow
def test_a_division_by_zero_is_not_lost_in_compiled_code() -> None:
    values = np.array([0.0, 0.0, 0.0, 1.0])
    rule = compile_rule(NamedRule(divide, FILTER_ARGUMENTS), FILTER)
    rule(NO_VALUES, NO_VALUES, generator("", ""), NO_VALUES, values, 3.0)
    assert values[0] == math.inf
    assert math.isnan(values[1])
    assert values[2] == 1.0


def test_why_a_rule_cannot_be_compiled_is_said() -> None:
    def inner(values: Array) -> None:
        values[0] = offset

    def local(values: Array) -> None:
        values[0] = 0.0

    offset = float(os.getpid())
    for rule, reason in (
        (inner, "inside a function"),
        (local, "inside a function"),  # another one at each call: it would be compiled each time
        (Live().smooth, "plain function"),
    ):
        with pytest.raises(NotCompilable, match=reason):
            compile_rule(NamedRule(rule, FILTER_ARGUMENTS), FILTER)
    with pytest.raises(NotCompilable):
        compile_rule(observe, FILTER)  # three arguments, six wanted
    plain = NamedRule(smooth, FILTER_ARGUMENTS, memory=Memory)
    assert isinstance(compile_rule(plain, FILTER), CompiledRule)


def raising(time: float) -> None:
    if time > 3.0:
        raise ValueError("my own trouble")


def asserting(time: float) -> None:
    assert time <= 3.0


@pytest.mark.parametrize("rule", [raising, asserting])
def test_a_rule_that_raises_is_interpreted_so_that_its_error_is_not_lost(rule: Any) -> None:
    with pytest.raises(NotCompilable, match="raises errors"):
        compile_rule(NamedRule(rule, FILTER_ARGUMENTS), FILTER)


WARM = """
import sys, numpy as np
from numba.core import event
from evoros.config.compose import compose
from evoros.mission.rollout import run_mission
class Compiles(event.Listener):
    count = 0
    def on_start(self, e): self.count += 1
    def on_end(self, e): pass
listener = Compiles()
event.register("numba:compile", listener)
experiment = compose(["simulator=planar", "course.time_limit_s=5", "failure=random"]).build()
rng = np.random.default_rng(0)
design = experiment.space.decode(rng.random(experiment.space.size))
for mission in experiment.plan.evaluation(0, 0, design):
    run_mission(experiment.scenario, mission)
print(listener.count)
"""


@pytest.mark.slow
def test_a_new_process_finds_everything_on_disk() -> None:
    """This process compiles what no other has; the next one compiles nothing at all.

    That compilations are counted is shown below, where a rule changes.
    """
    exec(WARM, {"__name__": "warm"})
    done = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True, check=True)
    assert int(done.stdout) == 0


HELPER = """
from evoros.base.compilable import compilable

@compilable
def increase(value: float) -> float:
    return value + 1.0
"""

PROBE = """
from evoros.geometry.increase import increase

def probe(values):
    values[0] = increase(values[0])
"""

RUN_PROBE = """
import numpy as np
from numba.core import event
from evoros.compilation.rules import FILTER, compile_rule
from evoros.base.rng import generator
from evoros.compilation.named_rules import NamedRule
from evoros.filter.probe import probe
from evoros.filter.protocol import FILTER_ARGUMENTS
with event.install_recorder("numba:compile") as compiles:
    rule = compile_rule(NamedRule(probe, FILTER_ARGUMENTS), FILTER)
values, empty = np.zeros(1), np.zeros(0)
rule(empty, empty, generator("", ""), empty, values, 0.0)
print(values[0], len(compiles.buffer) > 0)
"""


@pytest.mark.slow
def test_compiled_code_is_found_again_until_a_source_that_it_calls_changes(tmp_path: Path) -> None:
    """The source lies in another folder of the package than the rule."""
    source = tmp_path / "source"
    shutil.copytree(PACKAGE, source / "evoros", ignore=shutil.ignore_patterns("*.pyc"))
    helper = source / "evoros" / "geometry" / "increase.py"
    helper.write_text(HELPER)
    (source / "evoros" / "filter" / "probe.py").write_text(PROBE)
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(source)}

    def run() -> str:
        command = [sys.executable, "-c", RUN_PROBE]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    assert [run(), run()] == ["1.0 True", "1.0 False"]
    helper.write_text(HELPER.replace("1.0", "2.0"))
    assert run() == "2.0 True"


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the package, whose sources a test may change."""
    package = tmp_path / "evoros"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("*.pyc"))
    monkeypatch.setattr(machine_code, "PACKAGE", package)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return package


def find_folder() -> Path | None:
    """Return the folder of compiled code for the sources as they are now."""
    machine_code._hash_reachable.cache_clear()
    machine_code._list_modules.cache_clear()
    return machine_code.cache_folder.__wrapped__()


LOADED = """
import pkgutil, sys
from importlib import import_module

import evoros
from evoros.compilation.machine_code import RULE_ROOMS

for room in RULE_ROOMS:
    package = import_module(f"evoros.{room}")
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        import_module(module.name)
print(*(module.__file__ for name, module in sys.modules.items() if name.startswith("evoros.")))
"""


@pytest.mark.slow
def test_what_a_rule_can_reach_selects_another_folder_and_nothing_else_does(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All modules that the rooms of rules load can change a rule; a figure and a plug-in cannot."""
    hashed: set[Path] = set()
    read_bytes = Path.read_bytes

    def read(path: Path) -> bytes:
        hashed.add(path)
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", read)
    first = find_folder()
    command = [sys.executable, "-c", LOADED]
    done = subprocess.run(command, cwd=copied.parent, capture_output=True, text=True, check=True)
    loaded = {Path(name).resolve() for name in done.stdout.split()}
    assert {"base", "mission", "engines", "urdf"} <= {file.parent.name for file in loaded}
    assert loaded <= hashed
    others = ("analysis/figures", "plugins", "cli", "session", "observers", "optimizer")
    beyond = {file for folder in others for file in (copied / folder).rglob("*.py")}
    assert hashed.isdisjoint(beyond - loaded)
    for file in (copied / "base" / "arrays.py", *sorted(loaded)[::40]):
        before = file.read_text()
        file.write_text(f"{before}#")
        assert find_folder() != first, file
        file.write_text(before)
    renamed = copied / "mission" / "loop.py"
    renamed.rename(renamed.with_name("renamed.py"))
    assert find_folder() != first


def test_rules_reach_no_room_above_the_floor_of_missions() -> None:
    floors = configparser.ConfigParser()
    floors.read(ROOT / ".importlinter")
    layers = floors["importlinter:contract:layers"]["layers"].split("evoros.mission\n")[1]
    below = {name.removeprefix("evoros.") for name in layers.replace("|", " ").split()}
    assert set(machine_code.RULE_ROOMS) <= {"mission", *below}


ANYWHERE = """
from evoros.compilation import machine_code, rules
from evoros.compilation.named_rules import NamedRule
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.filter.silence import Silence
print(machine_code.cache_folder())
rule = NamedRule(Silence.rule, FILTER_ARGUMENTS, Silence.Parameters)
rules.compile_rule(rule, rules.FILTER)
"""


@pytest.mark.slow
@pytest.mark.parametrize("writable", [True, False])
def test_without_a_cache_at_home_another_place_is_found_or_none(
    tmp_path: Path, writable: bool
) -> None:
    """In neither case does compiling fail."""
    blocked = tmp_path / "file"
    blocked.write_text("")
    other = tmp_path / "other"
    other.mkdir()
    if not writable:  # as another user's, which root could write to
        (other / f"evoros-{os.getuid()}").write_text("")
    done = subprocess.run(
        [sys.executable, "-c", ANYWHERE],
        env={**os.environ, "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(other)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith(str(other) if writable else "None")
    assert ("every process compiles the rules again" in done.stderr) is not writable


@pytest.mark.parametrize("lower", [False, True])
def test_code_that_others_could_have_written_is_not_run(
    lower: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither from a folder of theirs, nor from one that they could put into ours."""
    home, other = tmp_path / "home", tmp_path / "other"
    other.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    monkeypatch.setattr("tempfile.tempdir", str(other))

    def folder(umask: int) -> Path:
        before = os.umask(umask)
        try:
            chosen = machine_code.cache_folder.__wrapped__()
        finally:
            os.umask(before)
        assert chosen is not None
        return Path(chosen)

    ours = folder(0o002)
    assert ours.parent == home / "evoros"
    assert folder(0o022) == ours
    (ours if lower else ours.parent).chmod(0o777)
    assert folder(0o022).parent == other / f"evoros-{os.getuid()}"

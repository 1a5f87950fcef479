"""Each bundled rule alone: packing keeps its named tuples, and compiled it has the same bits."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hydra.utils import instantiate
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, NO_VALUES, POSE_SIZE, STATE_SIZE, Array
from evoros.base.errors import InputError
from evoros.base.packing import unpack
from evoros.base.rng import Generator, generator
from evoros.compilation.named_rules import UNUSED, Bound, Started, bind
from evoros.compilation.rules import FILTER, LAYER, compile_rule
from evoros.config.compose import compose
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, LAYER_ARGUMENTS, Controller, Estimator
from evoros.files.resources import bundled_folder
from evoros.filter.protocol import FILTER_ARGUMENTS, Channels, Filter
from evoros.robot.model import Robot

FILTERS = {path.stem: path for path in sorted(bundled_folder("conf").glob("filter/*.yaml"))}
LAYERS = [
    ("controller=rover", 0),
    ("controller=rover", 1),
    ("controller/avoidance=blind", 0),
    ("controller=rover_l1", 1),
    ("controller=neural", 0),
]
TICKS, PERIOD = 5, 0.1
everywhere = settings(deadline=None, max_examples=10)  # the first call compiles
seeds = st.integers(0, 2**32 - 1)


class Case(NamedTuple):
    """A rule with its start."""

    rule: Callable[..., Any]
    arguments: tuple[str, ...]
    started: Started
    readings: int = 0

    def bind(self) -> Bound:
        return bind(self.rule, self.arguments, self.started)


@cache
def subject(override: str) -> tuple[Controller, Robot]:
    """Return the controller and the robot of a configuration, with a design."""
    experiment = compose(["simulator=planar", override]).build()
    genes = np.full(experiment.space.size, 0.6)
    member = experiment.members[0].with_design(experiment.space.decode(genes))
    assert isinstance(member.controller, Controller)
    return member.controller, member.robot


@cache
def built_filter(kind: str) -> Filter:
    part: Filter = instantiate(OmegaConf.load(FILTERS[kind]), _convert_="all")
    return part


def start_filter(kind: str, seed: int) -> Case:
    part, rng, n = built_filter(kind), generator(str(seed), kind), POSE_SIZE
    onset = rng.choice([0.0, 0.25, np.inf], n)
    try:
        started = part.start(
            Channels(np.full(n, 0.06), np.full(n, 4.5), np.zeros((n, 3)), PERIOD), onset, rng
        )
    except InputError:  # it filters poses only
        unlimited = np.full(n, np.inf)
        started = part.start(Channels(-unlimited, unlimited, np.zeros((n, 3)), PERIOD), onset, rng)
    return Case(part.rule, FILTER_ARGUMENTS, started)


def start_layer(override: str, place: int, seed: int) -> Case:
    controller, robot = subject(override)
    with controller.open(robot, lambda name: generator(str(seed), name)) as layers:
        layer = layers[place]
    return Case(layer.rule, LAYER_ARGUMENTS, layer.started, robot.channel_count)


def start_estimator() -> Case:
    controller, robot = subject("experiment=reckoning")
    part = next(iter(controller.localization.values()))
    assert isinstance(part, Estimator)
    started = part.start_estimate(robot, controller.period_s)
    return Case(part.rule, ESTIMATOR_ARGUMENTS, started, robot.channel_count)


def check_packing(case: Case) -> None:
    """Require that unpacking gives the values of the start."""
    bound = case.bind()
    pair: Any = case.started if type(case.started) is tuple else (case.started, None)
    kinds = bound.rule.parameters, bound.rule.memory
    for values, kind, packed in zip(pair, kinds, (bound.parameters, bound.memory), strict=True):
        if values is not None:
            assert same(unpack(kind, packed), values)


def same(one: Any, other: Any) -> bool:
    """Whether two tuples have equal bits and shapes; any NaN equals any NaN."""
    return all(
        np.shape(a) == np.shape(b) and bits(a) == bits(b) for a, b in zip(one, other, strict=True)
    )


def bits(values: Any) -> bytes:
    return np.where(np.isnan(values), np.nan, np.float64(values)).tobytes()


def check_compiled(case: Case, signature: Any, seed: int) -> None:
    """Require that a rule gives the same bits compiled and interpreted, tick by tick."""
    code, results = compile_rule(case.bind().rule, signature), []
    for compiled in (True, False):
        bound, inputs = case.bind(), np.random.default_rng(seed)
        rng, results_of_ticks = generator(str(seed), "rule"), []
        for tick in range(TICKS):
            arguments = draw_arguments(case, inputs, rng, tick * PERIOD)
            rule = code if compiled else bound.rule
            answer = rule(bound.parameters, bound.memory, *arguments)
            changed = [value.copy() for value in arguments if isinstance(value, np.ndarray)]
            results_of_ticks += [*changed, bound.memory.copy(), float(bool(answer)), rng.random()]
        results.append(results_of_ticks)
    assert same(*results)


def draw_arguments(
    case: Case, inputs: np.random.Generator, rng: Generator, time: float
) -> list[Any]:
    """Draw the arguments of a call: readings in range, at the maximum and silent."""
    readings = inputs.choice([0.3, 1.7, 4.5, np.nan], case.readings or POSE_SIZE)
    drawn: dict[str, Array] = {
        "readings": readings,
        "values": readings,
        UNUSED: NO_VALUES,
        "pose": inputs.uniform(-1.0, 1.0, POSE_SIZE),
        "state": inputs.uniform(-1.0, 1.0, STATE_SIZE),
        "leg": inputs.uniform(-5.0, 5.0, LEG_SIZE),
        "command": np.zeros(COMMAND_SIZE),
    }
    return [{"rng": rng, "time": time}.get(name, drawn.get(name)) for name in case.arguments[2:]]


@pytest.mark.parametrize("kind", FILTERS)
@everywhere
@given(seed=seeds)
def test_filters(kind: str, seed: int) -> None:
    case = start_filter(kind, seed)
    check_packing(case)
    check_compiled(case, FILTER, seed)


@pytest.mark.parametrize(("override", "place"), LAYERS)
@everywhere
@given(seed=seeds)
def test_layers_of_controllers(override: str, place: int, seed: int) -> None:
    case = start_layer(override, place, seed)
    check_packing(case)
    check_compiled(case, LAYER, seed)


@everywhere
@given(seeds)
def test_localization(seed: int) -> None:
    case = start_estimator()
    check_packing(case)
    check_compiled(case, FILTER, seed)

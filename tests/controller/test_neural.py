"""The neural controller: symmetric, without weights a pilot, and evolved with the design."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers import content, copied, cut, resume, scored, tiny
from hypothesis import given
from hypothesis import strategies as st
from mission_cases import run_interpreted

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.controller.neural import Neural, list_weights, share_sectors
from evoros.design.genes import Gene
from evoros.evolution.experiment import Experiment
from evoros.mission.member import find_declared_genes
from evoros.mission.participant import start_layers
from evoros.mission.rollout import run_mission
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.terminal.console import DONE

NEURAL = ["controller=neural", "simulator=planar", "executor=serial"]
CRUISE = 0.29  # of conf/controller/neural.yaml


@cache
def experiment_of(*overrides: str) -> Experiment:
    return compose([*NEURAL, *overrides]).build()


def robot(yaws_deg: list[float]) -> Robot:
    mounts = [Mount("sonar", "base_link", 0.0, 0.0, 0.1, yaw, 12.5) for yaw in yaws_deg]
    return experiment_of().robot.with_sensors(mounts, experiment_of().design.sensors)


class Drive:
    """One mission of a network: its layers, called again and again."""

    def __init__(self, network: Neural, yaws_deg: list[float]) -> None:
        with network.open(robot(yaws_deg), lambda name: generator("seed", name)) as layers:
            self.layers = start_layers(layers)

    def __call__(
        self, readings: list[float], bearing: float, yaw: float = 0.0, speed: float = CRUISE
    ) -> tuple[int, Array]:
        """The number of the mode that decides, 0 if none does, and the command."""
        command = np.array([math.inf, math.inf])
        state = np.array([1.0, 2.0, yaw, speed, 0.0, 0.0])
        leg = np.array([0.0, 0.0, 1.0 + 5 * math.cos(bearing), 2.0 + 5 * math.sin(bearing)])
        for mode, (rule, parameters, memory) in enumerate(self.layers, 1):
            if rule(parameters, memory, state, leg, np.array(readings), 0.0, command):
                return mode, command
        return 0, command


def network(seed: int, **values: Any) -> Neural:
    """A network with random weights."""
    empty = Neural(**values)
    assert empty.weights is not None
    weights = np.random.default_rng(seed).normal(0.0, 1.0, len(empty.weights)).tolist()
    return replace(empty, weights=weights)


facings = st.floats(-170, 170)
ranges = st.one_of(st.floats(0.06, 4.5), st.just(math.nan))
sensors = st.lists(st.tuples(facings, ranges), max_size=6)


@given(sensors, st.floats(-3.0, 3.0), st.integers(0, 2))
def test_without_weights_it_heads_for_the_waypoint(
    pairs: list[tuple[float, float]], bearing: float, hidden: int
) -> None:
    yaws, readings = [yaw for yaw, _ in pairs], [reading for _, reading in pairs]
    lock = experiment_of().robot.drive.steering_limit
    for recurrent in (False, True):
        pilot = Drive(Neural(hidden=hidden + 1, recurrent=recurrent), yaws)
        _, command = pilot(readings, bearing)
        assert command[STEERING] == pytest.approx(min(max(1.5 * bearing, -lock), lock), abs=1e-9)
        assert command[DRIVE_SPEED] == CRUISE


@given(sensors, st.floats(-3.0, 3.0), st.integers(0, 9), st.booleans(), st.sampled_from([1, 5, 9]))
def test_the_mirror_image_of_what_it_sees_gives_that_of_the_command(
    pairs: list[tuple[float, float]], bearing: float, seed: int, recurrent: bool, sectors: int
) -> None:
    yaws, readings = [yaw for yaw, _ in pairs], [reading for _, reading in pairs]
    evolved = network(seed, recurrent=recurrent, sectors=sectors)
    left, right = Drive(evolved, yaws), Drive(evolved, [-yaw for yaw in yaws])
    for _ in range(3):  # and so do its memories
        (mode, one), (twin, other) = left(readings, bearing), right(readings, -bearing)
        assert mode == twin
        assert other[STEERING] == pytest.approx(-one[STEERING], abs=1e-9)
        assert other[DRIVE_SPEED] == pytest.approx(one[DRIVE_SPEED], abs=1e-9)


def test_one_that_need_not_be_symmetric_is_not() -> None:
    evolved = network(1, symmetric=False)
    _, one = Drive(evolved, [20.0])([0.5], 0.3)
    _, other = Drive(evolved, [-20.0])([0.5], -0.3)
    assert abs(one[STEERING] + other[STEERING]) > 0.01


@given(sensors, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.integers(0, 9), st.booleans())
def test_without_the_waypoint_its_bearing_changes_nothing(
    pairs: list[tuple[float, float]], bearing: float, other: float, seed: int, symmetric: bool
) -> None:
    yaws, readings = [yaw for yaw, _ in pairs], [reading for _, reading in pairs]
    evolved = network(seed, waypoint=False, symmetric=symmetric)
    assert "bearing" not in " ".join(evolved.evolved)
    (mode, one), (twin, two) = (Drive(evolved, yaws)(readings, at) for at in (bearing, other))
    assert (mode, one.tolist()) == (twin, two.tolist())
    seeing = replace(evolved, waypoint=True, weights=None)
    weights = dict.fromkeys(seeing.evolved, 0.0)  # with no weight of the bearing, ahead it is alike
    weights |= dict(zip(evolved.evolved, evolved.weights or (), strict=True))
    _, ahead = Drive(replace(seeing, weights=[*weights.values()]), yaws)(readings, 0.0)
    assert ahead == pytest.approx(one, abs=1e-12)


@given(sensors, st.floats(-3.0, 3.0), st.integers(0, 99))
def test_every_command_is_one_that_the_robot_can_drive(
    pairs: list[tuple[float, float]], bearing: float, seed: int
) -> None:
    yaws, readings = [yaw for yaw, _ in pairs], [reading for _, reading in pairs]
    _, command = Drive(network(seed), yaws)(readings, bearing)
    fastest = experiment_of().robot.drive.max_speed_mps
    assert 0.1 - 1e-12 <= command[DRIVE_SPEED] <= fastest + 1e-12
    assert abs(command[STEERING]) <= experiment_of().robot.drive.steering_limit


def test_it_avoids_while_something_is_within_range_and_decides_nothing_without_a_pose() -> None:
    drive = Drive(network(2), [0.0, 30.0, 179.0])
    assert drive([2.0, 4.5, 4.5], 0.1)[0] == 2
    assert drive([1.9, 4.5, 4.5], 0.1)[0] == 1
    assert drive([4.5, 4.5, 0.3], 0.1)[0] == 2  # behind the outermost sectors
    assert drive([math.nan, math.nan, math.nan], 0.1)[0] == 2
    mode, command = drive([0.5, 0.5, 0.5], math.nan)
    assert mode == 0
    assert np.isinf(command).all()


def test_only_a_recurrent_network_remembers() -> None:
    for recurrent in (False, True):
        drive = Drive(network(3, recurrent=recurrent), [10.0])
        first = drive([4.5], 0.2)[1].tobytes()
        drive([0.3], 0.2)
        assert (drive([4.5], 0.2)[1].tobytes() == first) is not recurrent


@given(st.lists(st.floats(-math.pi, math.pi), max_size=5), st.sampled_from([1, 3, 5, 7]))
def test_a_reading_is_shared_by_the_two_sectors_next_to_it(yaws: list[float], sectors: int) -> None:
    span = math.pi
    entries = share_sectors(yaws, sectors, span)
    middles = np.linspace(-span / 2, span / 2, sectors) if sectors > 1 else np.zeros(1)
    width = span / max(sectors - 1, 1)
    for yaw, entry in zip(yaws, entries, strict=True):
        shares = np.zeros(sectors)
        for sector, share in entry.reshape(2, 2):
            shares[int(sector)] += share
        expected = np.maximum(0.0, 1.0 - np.abs(middles - yaw) / width)
        np.testing.assert_allclose(shares, expected, atol=1e-9)


@pytest.mark.parametrize("recurrent", [False, True])
@pytest.mark.parametrize("symmetric", [False, True])
def test_compiled_and_interpreted_bits_are_the_same(recurrent: bool, symmetric: bool) -> None:
    limits = ["course.time_limit_s=8", "world=boxes"]
    shape = [f"controller.recurrent={recurrent}", f"controller.symmetric={symmetric}"]
    experiment = experiment_of(*limits, *shape)
    rng = np.random.default_rng(5)
    design = experiment.space.decode(rng.random(experiment.space.size))
    (mission,) = experiment.plan.evaluation(0, 0, design)
    (whole, track), (stepped, steps) = (
        run_mission(experiment.scenario, mission),
        run_mission(experiment.scenario, mission, run_interpreted),
    )
    assert repr(whole) == repr(stepped)
    assert track.tobytes() == steps.tobytes()


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"weights": [0.5] * 3}, "Neural.weights: must be 41 numbers"),
        ({"weights": ["a"]}, "Neural.weights: must be a list of numbers"),
        ({"sectors": 4}, "Neural.sectors: must be an odd integer"),
        ({"hidden": 0}, "Neural.hidden: must be"),
        ({"min_speed_mps": 0.5}, "Neural.min_speed_mps: must be at most speed_mps"),
        ({"weight_limit": 0.0}, "Neural.weight_limit: must be"),
    ],
)
def test_what_makes_no_network_is_refused_in_one_line(values: dict[str, Any], problem: str) -> None:
    with pytest.raises(InputError) as caught:
        Neural(**values)
    assert str(caught.value).startswith(problem)
    assert "\n" not in str(caught.value)


def test_a_speed_that_the_robot_cannot_drive_is_refused() -> None:
    with pytest.raises(InputError, match=r"Neural\.speed_mps: must be at most") as caught:
        Drive(Neural(speed_mps=0.4), [0.0])
    assert "\n" not in str(caught.value)


def test_a_sensor_that_reads_its_maximum_sees_nothing_whatever_the_range_of_the_network() -> None:
    drive = Drive(network(4, range_m=9.0), [0.0])
    assert drive([4.5], 0.1)[0] == 2
    assert drive([4.4], 0.1)[0] == 1


# As genes


def test_each_weight_is_a_gene_and_those_of_a_neuron_are_inherited_together() -> None:
    space = experiment_of().space
    bare = experiment_of("controller.evolve=false").space
    weights = list_weights(5, 4, symmetric=True, recurrent=False, waypoint=True)
    assert space.size == bare.size + len(weights)
    neurons = {weight.neuron for weight in weights}
    assert {block.name for block in space.blocks} == neurons | {b.name for b in bare.blocks}
    middle = space.decode(np.full(space.size, 0.5)).values
    assert middle == {f"controller.weights.{i}": 0.0 for i in range(len(weights))}
    row = space.to_row(np.ones(space.size))
    assert {row[weight.name] for weight in weights} == {3.0}


def test_the_genes_of_a_design_reach_the_network() -> None:
    experiment = experiment_of()
    genome = np.random.default_rng(1).random(experiment.space.size)
    design = experiment.space.decode(genome)
    controller = experiment.members[0].with_design(design).controller
    assert isinstance(controller, Neural)
    assert list(controller.weights or ()) == list(design.values.values())


def test_a_gene_of_the_design_must_not_be_one_of_the_network() -> None:
    for name, key in (("mine", "controller.weights.3"), ("hidden0_from_bias", "controller.gain")):
        experiment = experiment_of()
        genes = {name: Gene(key, 0.5, 2.0)}
        with pytest.raises(InputError, match="must differ in name and key") as caught:
            _ = replace(experiment, design=replace(experiment.design, genes=genes)).space
        assert "\n" not in str(caught.value)
    gain = {"gain": Gene("controller.gain", 0.5, 2.0)}
    both = replace(experiment, design=replace(experiment.design, genes=gain))
    assert both.space.size == experiment.space.size + 1


def test_any_layer_may_declare_genes() -> None:
    class Layer(Neural):
        pass

    genes = find_declared_genes({"first": Layer(hidden=1)})
    assert {gene.key for gene in genes.values()} == {
        f"controller.first.weights.{i}" for i in range(11)
    }
    with pytest.raises(InputError, match="must not declare the gene hidden0_from_bias"):
        find_declared_genes({"first": Layer(hidden=1), "second": Layer(hidden=1)})


@pytest.mark.slow
def test_a_run_an_evaluation_and_a_resumed_run_carry_the_weights(tmp_path: Path) -> None:
    run = tmp_path / "run"
    small = ["optimizer.generations=1", "optimizer.population_size=4", *NEURAL]
    assert tiny(run, *small) == DONE
    stopped = copied(run, tmp_path / "stopped")
    cut(stopped, 3 * (stopped / "missions.csv").stat().st_size // 4)
    assert resume(stopped) == DONE
    assert content(stopped) == content(run)
    names = [weight.name for weight in list_weights(5, 4, True, False, True)]
    genes = pd.read_csv(run / "champion/genes.csv")
    assert genes.gene.tolist() == names
    last = pd.read_csv(sorted((run / "generations").glob("*.csv"))[-1])
    champion = last[last.id == genes.design[0]].iloc[0]
    assert champion[names].tolist() == genes.value.tolist()
    given_genes = pd.read_csv(scored(tmp_path / "scored", run, *NEURAL) / "genes_in.csv")
    assert given_genes.value.tolist() == genes.value.tolist()


# At a price


@pytest.mark.slow
def test_every_mission_has_the_price_of_the_sensors_of_its_design() -> None:
    few = ["design=priced_sensors", "course.time_limit_s=1", "world=boxes"]
    experiment = experiment_of(*few)
    prices = {name: sensor.price for name, sensor in experiment.design.sensors.items()}
    rng = np.random.default_rng(7)
    types: set[str] = set()
    for genome in rng.random((6, experiment.space.size)):
        design = experiment.space.decode(genome)
        (mission,) = experiment.plan.evaluation(0, 0, design)
        (outcome,), _ = run_mission(experiment.scenario, mission)
        assert outcome.sensors == len(design.mounts)
        assert outcome.price == sum(prices[mount.sensor] for mount in design.mounts)
        types |= {mount.sensor for mount in design.mounts}
        refused = replace(design, values={"controller.gain": -1.0})
        (failed,), _ = run_mission(experiment.scenario, replace(mission, design=refused))
        assert (failed.ended, failed.price) == ("refused", outcome.price)
    assert types == set(prices)


def test_prices_do_not_evolve() -> None:
    with pytest.raises(InputError, match=r"Gene\.key: must be a key other than a price") as caught:
        Gene("design.sensors.sonar.price", 0.0, 1.0)
    assert "\n" not in str(caught.value)


# Of several robots


def test_a_robot_with_a_design_of_its_own_has_weights_of_its_own() -> None:
    shared = experiment_of("agents=oncoming", "world=boxes")
    design = shared.space.decode(np.full(shared.space.size, 0.9))
    first, other = (member.controller for member in shared.scenario.equip(design))
    assert isinstance(first, Neural)
    assert isinstance(other, Neural)
    assert first.weights == other.weights != Neural().weights
    (name,) = shared.agents
    agents = {name: replace(shared.agents[name], design=shared.design, scored=True)}
    separate = replace(shared, agents=agents)
    assert separate.space.size == 2 * shared.space.size
    row = separate.space.to_row(np.linspace(0.0, 1.0, separate.space.size))
    assert row[f"{name}.hidden0_from_bias"] > row["hidden0_from_bias"]  # type: ignore[operator]

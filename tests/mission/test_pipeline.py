"""The chains of filters of a mission: each part has draws of its own."""

from functools import partial

import numpy as np
import pytest
from numpy.random import Generator
from sensor_cases import equip, start_chain

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.failure.combined import CombinedFailure
from evoros.failure.protocol import Failure, Fault
from evoros.failure.random import RandomFailure
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.protocol import Channels, Filter
from evoros.filter.silence import Silence
from evoros.sensor.odometry import Odometry


def failing(effect: Filter, count: int = 1) -> RandomFailure:
    return RandomFailure(count, 0.0, 1.0, effect)


class Several(Failure):
    """The same noise on all sensors, so many times."""

    def __init__(self, times: int) -> None:
        self.times = times

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return self.times * failing(GaussianNoise(0.2), channels.size).draw(channels, rng)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose([]).build()


def heard(experiment: Experiment, failure: Failure, seconds: float = 3.0) -> Array:
    """(ticks, sensors): what the controller reads of constant ranges under the failure."""
    space = experiment.space
    design = space.decode(np.full(space.size, 0.5))
    robot = experiment.robot.with_sensors(design.mounts, experiment.design.sensors)
    draws = partial(generator, "test")
    faults = failure.draw(robot.describe_sensors(), draws("failure"))
    raw, readings = np.full(len(robot.mounts), 2.0), np.zeros(len(robot.mounts))
    chain = start_chain(robot, faults, raw, readings, draws)
    rows = []
    for tick in range(round(10 * seconds)):
        for stage in chain:
            stage.rule(*stage[2:7], 0.1 * tick)
        rows.append(readings.copy())
    return np.array(rows)


@pytest.mark.parametrize("added", [Silence(), GaussianNoise(0.3)])
@pytest.mark.parametrize("count", [1, 2])
def test_a_failure_added_before_another_does_not_shift_its_noise(
    experiment: Experiment, added: Silence | GaussianNoise, count: int
) -> None:
    noisy = failing(GaussianNoise(0.2))
    first = failing(added, count)
    alone = heard(experiment, CombinedFailure({"noisy": noisy}))
    both = heard(experiment, CombinedFailure({"first": first, "noisy": noisy}))
    intact = heard(experiment, CombinedFailure())
    hit = (alone != intact).any(axis=0)
    spared = hit & (heard(experiment, CombinedFailure({"first": first})) == intact).all(axis=0)
    assert hit.sum() == spared.sum() == 1  # the failures meet different sensors
    assert np.array_equal(alone[:, spared], both[:, spared])


def test_faults_of_one_name_have_draws_of_their_own(experiment: Experiment) -> None:
    intact, once, twice = (
        heard(experiment, failure) for failure in (Several(0), Several(1), Several(2))
    )
    assert not np.allclose(once[-1], intact[-1])
    assert not np.allclose(twice[-1] - intact[-1], 2 * (once[-1] - intact[-1]))


def test_each_sensor_reads_its_own_signal(experiment: Experiment) -> None:
    """Odometry divides what its own signal gained since the last reading by the time."""
    mounts = [("odometry", 0.0, 0.0, 0.0, 0.0)] * 2
    robot = equip(experiment.robot, *mounts, odometry=Odometry())
    signals, readings = np.array([0.1, 0.2, 0.3, 0.4]), np.zeros(4)
    for stage in start_chain(robot, (), signals, readings, partial(generator, "test")):
        stage.rule(*stage[2:7], 0.5)
    assert readings == pytest.approx(signals / 0.5)

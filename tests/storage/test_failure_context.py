"""How setting.json tells drawn failures from others, whatever their class."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import USER_PARTS
from numpy.random import Generator

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.failure.combined import CombinedFailure
from evoros.failure.exhaustive import ExhaustiveFailure
from evoros.failure.given import GivenFailure
from evoros.failure.none import NoFailure
from evoros.failure.protocol import Failure, Fault
from evoros.failure.random import RandomFailure
from evoros.filter.bias import Bias
from evoros.filter.drift import Drift
from evoros.filter.dropout import Dropout
from evoros.filter.protocol import Channels, Filter
from evoros.filter.stuck import Stuck
from evoros.storage.figure_context import FailureContext, describe_failure


class EveryOne(Failure):
    """Its filter is known from its faults alone."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return (Fault(Stuck(), np.zeros(channels.size)),)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return compose(["experiment=tiny", "trials=5"], config_dir=USER_PARTS).build()


@pytest.mark.parametrize(
    ("failure", "expected"),
    [
        (RandomFailure(), FailureContext()),
        (NoFailure(), FailureContext(drawn=False, always_intact=True)),
        (GivenFailure((0,)), FailureContext(drawn=False)),
        (GivenFailure(), FailureContext(drawn=False, always_intact=True)),
        (ExhaustiveFailure(), FailureContext(drawn=False)),
    ],
)
def test_a_model_is_told_by_what_it_does(
    experiment: Experiment, failure: Failure, expected: FailureContext
) -> None:
    failing = replace(experiment, failure=failure)
    context = describe_failure(failing, failing.members[0])
    assert replace(context, effects={}) == expected
    assert context.effects == ({} if isinstance(failure, NoFailure) else {"silence": "ends"})


@pytest.mark.parametrize(
    ("effect", "told"),
    [(Drift(), "grows"), (Bias(), "alters"), (Dropout(1.0), "ends"), (Dropout(0.5), "alters")],
)
def test_figures_are_told_what_a_filter_declares(
    experiment: Experiment, effect: Filter, told: str
) -> None:
    failure = CombinedFailure({"some": RandomFailure(effect=effect), "other": EveryOne()})
    failing = replace(experiment, failure=failure)
    context = describe_failure(failing, failing.members[0])
    assert context.effects == {effect.name.lower(): told, "stuck": "ends"}

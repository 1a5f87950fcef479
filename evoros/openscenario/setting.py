"""Builds what a scenario file names: an experiment, its mission, and failures."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from evoros.base.errors import InputError
from evoros.config.jobs import Job, Jobs
from evoros.config.like import EVALUATE
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import Failure
from evoros.mission.mission import Mission
from evoros.mission.scenario import Scenario
from evoros.session.evaluation import read_sources
from evoros.session.like import read_like


@dataclass(frozen=True)
class Setting:
    """The mission of a scenario file, and all that it needs."""

    scenario: Scenario
    mission: Mission
    agents: Sequence[str]


@cache
def build_setting(overrides: tuple[str, ...], config_dir: str | None, trial: int) -> Setting:
    """Build the mission that ``evoros evaluate`` runs with these overrides as this trial.

    A design without genes needs no key ``designs``.

    Raises:
        InputError: a value cannot be used, or the overrides leave several designs or worlds.
    """
    experiment, designs = _build(overrides, config_dir)
    if designs is None and not experiment.space.size:
        design = experiment.space.decode(np.empty(0))
    else:
        named = read_sources(designs, experiment)
        if len(named) != 1:
            raise InputError(f"designs: must be one design, not {len(named)}; name one of them")
        design = named[0].design
    if len(experiment.world) != 1:
        raise InputError(
            f"world: must be one world, not {', '.join(experiment.world)}; choose one, as in "
            f"world=maze"
        )
    missions = experiment.plan.evaluation(0, 0, design)
    if not 0 <= trial < len(missions):
        raise InputError(
            f"trial: must be from 0 to {len(missions) - 1}, not {trial}; raise trials, or choose "
            f"another"
        )
    scenario = experiment.scenario_for(experiment.evaluation_draws)
    return Setting(scenario, missions[trial], list(experiment.agents))


@cache
def build_failure(overrides: tuple[str, ...], config_dir: str | None) -> Failure:
    """Build the failure model that overrides choose.

    Raises:
        InputError: there is none, or a value cannot be used.
    """
    return _build(overrides, config_dir)[0].failure


def _build(overrides: tuple[str, ...], config_dir: str | None) -> tuple[Experiment, object]:
    """Build an experiment; return it with the value of the key ``designs``."""
    (job,) = (
        job
        for job in Jobs(overrides, False, config_dir, EVALUATE, read_like)
        if isinstance(job, Job)
    )
    return job.config.build(), job.config.designs


def split_words(key: str, text: str) -> tuple[str, ...]:
    """Return the words of a parameter, as a shell would.

    Raises:
        InputError: a quote is not closed.
    """
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise InputError(f"{key}: {error}, in {text!r}; close the quote") from None

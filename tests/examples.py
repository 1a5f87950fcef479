"""Composes the commands of the documents, and makes short runs with their examples."""

from collections.abc import Iterator
from pathlib import Path

from documents import split_command

import evoros
from evoros.cli.command import parse_options
from evoros.config.compose import compose, parse
from evoros.config.configuration import Configuration
from evoros.config.jobs import SWEEPER, Job, Jobs

SMALL = [
    "optimizer.population_size=2",
    "optimizer.generations=2",
    "optimizer.validation_trials=1",
    "figures=[]",
]
LIMIT = "world.yard.course.time_limit_s=5"
"""Ends the missions in the world of docs/parts/world.md after a few seconds."""


def composed(line: str, *more: str) -> Iterator[Configuration]:
    """The configurations of the jobs that a command runs."""
    name, *words = split_command(line)
    options = parse_options([*words, *more])
    primary = "evaluate" if name == "evoros evaluate" else "config"
    jobs = Jobs(options.overrides, options.multirun, options.config_dir, primary)
    if SWEEPER in jobs.plugins:  # it chooses the swept values, and jobs do not exist before
        given = [text for text in options.overrides if not parse([text])[0].is_sweep_override()]
        yield compose(given, config_dir=options.config_dir)
    for job in jobs:
        assert isinstance(job, Job), job
        yield job.config


def short_run(name: str, overrides: list[str]) -> evoros.Run:
    """A run of seconds in the simulator and the world of docs/parts."""
    common = ["simulator=kinematic", "simulator.time_step=0.1", "world=yard", LIMIT, *SMALL]
    config = compose(["executor=serial", *common, *overrides], config_dir="mine")
    return evoros.run(config, Path(name))

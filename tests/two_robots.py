"""A run with two robots, and its figures."""

from pathlib import Path

from helpers import finished_run

from evoros.analysis.products import make_product
from evoros.analysis.subcommands import Product, import_subcommand, parse
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.study import Study

HOME = (3.0, 3.0, -1.6)
TWO = (
    "simulator=planar",
    "world=plains",
    "agents=oncoming",
    f"agents.oncoming.home={list(HOME)}",
    "agents.oncoming.route=null",
    "+design@agents.oncoming.design=six_sonars",
    "optimizer.generations=1",
    "optimizer.population_size=2",
    "optimizer.validation_trials=0",
)


def load_two(folder: Path) -> Study:
    """A run in which the second robot has a design of its own."""
    return load_study([finished_run(folder / "run", *TWO)])


def draw(study: Study, *arguments: str) -> Product:
    return make_product(import_subcommand(arguments[0]), study, parse([*arguments, "run"]))

"""A run with two robots, and its figures."""

from evoros.analysis.products import make_product
from evoros.analysis.subcommands import Product, import_subcommand, parse
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


def draw(study: Study, *arguments: str) -> Product:
    return make_product(import_subcommand(arguments[0]), study, parse([*arguments, "run"]))

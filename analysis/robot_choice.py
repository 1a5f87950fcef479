"""The product of a subcommand, of one of several robots, with the factors in its tables."""

import argparse
from dataclasses import replace

from .product import Product
from .subcommands import Subcommand
from .tables.agents import choose_robot
from .tables.factor_columns import add_factors
from .tables.study import Study


def make_product(subcommand: Subcommand, study: Study, options: argparse.Namespace) -> Product:
    """Make the product of a subcommand; that of one robot says which one it shows."""
    chosen = getattr(subcommand, "ONE_ROBOT", False)
    if not chosen and not getattr(subcommand, "FIRST_ROBOT", False):
        return _add_factors(subcommand.make_product(study, options), study)
    choice = choose_robot(study, options.agent if chosen else None)
    product = _add_factors(subcommand.make_product(choice.study, options), choice.study)
    if not choice.others:
        return product
    others = ", ".join(choice.others)
    in_view = getattr(subcommand, "IN_VIEW", False)
    rest = f", with {others} in view" if in_view else f" alone, without {others}"
    about = choice.robot + rest
    if chosen and options.agent is None:
        about = f"{about}; --agent NAME shows another"
    return replace(product, messages=[*product.messages, about])


def _add_factors(product: Product, study: Study) -> Product:
    """Add the levels of the runs to all tables."""
    table = None if product.table is None else add_factors(product.table, study)
    tables = {name: add_factors(each, study) for name, each in product.tables.items()}
    return replace(product, table=table, tables=tables)

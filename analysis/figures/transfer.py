"""The same designs under two conditions: is who is good here good there?"""

import argparse
import math
from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from ..drawing.style import width as width_of
from ..drawing.transfer_figure import LEAST, ends, transfer
from ..measures.statistics import mean_interval, spearman
from ..product import Product
from ..tables.paired_scores import scored_twice
from ..tables.study import Study

HELP = "the same designs under two simulators, failures, worlds ...: rank correlation and loss"
NUMBERS = ("n", "spearman", "spearman_low", "spearman_high", "loss", "loss_low", "loss_high")


def arguments(parser: argparse.ArgumentParser) -> None:
    """The choice where evaluations differ in several parts."""
    parser.add_argument(
        "--between",
        metavar="PART",
        help="what differs between the axes, where evaluations differ in several parts: simulator, "
        "failure ...",
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: the picture, a row for each design, a summary, and what it says."""
    table = scored_twice(study, options.between)
    found = summary(table)
    wide = width_of(options.columns, 1 if table.groupby(["x", "y"]).ngroups == 1 else 2)
    files = {"transfer_summary.csv": found.to_csv(index=False, lineterminator="\n").encode()}
    said = [_conclusion(row) for row in found.to_dict("records")]
    return Product(table, transfer(table, found, wide), said, files)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each two conditions and group of ``scored_twice``, in its order.

    ``n`` designs; Spearman's rank correlation and the mean loss, each with a bootstrap interval.
    """
    rows = []
    for (x, y, group), own in table.groupby(["x", "y", "group"], sort=False):
        order = spearman(own["x_fitness"].to_numpy(float), own["y_fitness"].to_numpy(float))
        loss = mean_interval(own["loss"].to_numpy(float))
        numbers = (len(own), order.value, order.low, order.high, loss.value, loss.low, loss.high)
        rows.append((x, y, group, *numbers))
    return pd.DataFrame(rows, columns=["x", "y", "group", *NUMBERS])


def _conclusion(row: Mapping[Hashable, Any]) -> str:
    head = f'"{row["x"]}" to "{row["y"]}"' + (f", {row['group']}" if row["group"] else "")
    if row["n"] < LEAST:
        return f"{head}: too few designs ({row['n']}) for any conclusion: give at least {LEAST}"
    if math.isnan(row["spearman"]):
        return f"{head}: all designs are alike in one of the two: they have no order to be kept"
    order, loss = ends(row, "spearman"), ends(row, "loss")
    kept = "kept in part" if row["spearman_low"] > 0 else "not shown to be kept"
    less = (
        "fitness is lost,"
        if row["loss_low"] > 0
        else "fitness is gained, a loss of"
        if row["loss_high"] < 0
        else "no loss shown,"
    )
    return f"{head}: {row['n']} designs: order {kept}, rank correlation {order}; {less} {loss}"

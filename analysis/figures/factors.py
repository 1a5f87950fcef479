"""Two factors: what each does, and whether one changes what the other does."""

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError

from ..drawing.factor_panels import CROSS, draw_factors, list_levels
from ..drawing.style import figure_width
from ..product import Product
from ..statistics.comparison import format_p, title_measure
from ..statistics.factorial import Cell, Contrast, EffectTest, list_contrasts, permute_effects
from ..statistics.small_samples import LEVEL, holm
from ..tables.factors import follows
from ..tables.records import FITNESS, bound_measure, label_fitness
from ..tables.study import Study
from ..tables.treatments import describe_factor, describe_level, report_repeated
from .options import add_conditions, score_runs

HELP = "the effects of one or two factors and their interaction, with 95 % intervals"
NEEDS = "finished runs with replicates of each combination of levels"
FILES = {
    "factors.csv": "the tests",
    "factors_effects.csv": "the differences of means",
}
TESTS = ("measure", "effect", "df", "df_error", "f", "p", "p_holm")
EFFECTS = ("measure", "effect", "contrast", "difference", "low", "high")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the factors and of common conditions."""
    about = "one or two factors; those in which the runs differ, if these are no more than two"
    parser.add_argument("--factors", metavar="A,B", help=about)
    add_conditions(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the means of all combinations; the tables are the tests and the differences."""
    names = choose_factors(study, options.factors)
    runs, measures = score_runs(study, options.under)
    levels = {record.name: record.levels for record in study.records}
    for name in names:
        runs[f"level of {name}"] = [levels[run][name] for run in runs["run"]]
    repeated = report_repeated(record for record in study.records if record.name in set(runs.run))
    tests: list[dict[str, object]] = []
    effects: list[dict[str, object]] = []
    cells: dict[str, dict[Cell, Array]] = {}
    for measure in measures:
        cells[measure] = _group(runs, measure, names)
        tests += list_tests(measure, cells[measure], names)
        contrasts = list_contrasts(cells[measure], list_levels(cells[measure], names))
        effects += [_describe_contrast(measure, contrast) for contrast in contrasts]
    table = pd.DataFrame(tests, columns=list(TESTS))
    differences = pd.DataFrame(effects, columns=list(EFFECTS))
    label = label_fitness(study.records)
    bounds = {measure: bound_measure(measure, study.records) for measure in cells}
    figure = draw_factors(cells, names, table, bounds, figure_width(options.columns), label)
    messages = [*repeated, *conclude(table, differences, label)]
    return Product(table, figure, messages, {"factors_effects.csv": differences})


def choose_factors(study: Study, wanted: str | None) -> list[str]:
    """Choose the named factors, or those in which runs differ and which follow from no others."""
    columns = {
        name: tuple(record.levels[name] for record in study.records) for name in study.factors
    }
    chosen = [] if wanted is None else [part.strip() for part in wanted.split(",")]
    for name in columns if wanted is None else ():
        if not follows(columns[name], [columns[known] for known in chosen]):
            chosen.append(name)
    there = ", ".join(columns) or "none, because all runs are of one treatment"
    known = all(name in columns for name in chosen)
    if not known or len(set(chosen)) != len(chosen) or not 1 <= len(chosen) <= 2:
        raise InputError(
            f"--factors: must be one or two factors in which the runs differ ({there}), not "
            f"{wanted or 'left out'}; choose them, and fix others with --where"
        )
    others = [
        name
        for name, column in columns.items()
        if not follows(column, [columns[factor] for factor in chosen])
    ]
    if others:
        raise InputError(
            f"--factors: the runs also differ in {', '.join(others)}; fix these with --where"
        )
    return chosen


def _group(runs: pd.DataFrame, measure: str, names: Sequence[str]) -> dict[Cell, Array]:
    """Group the known values by their levels, in the order of the runs."""
    keys = [f"level of {name}" for name in names]
    known = runs[runs[measure].notna()]
    sets = [list(dict.fromkeys(known[key])) for key in keys]
    cells = {}
    for cell in product(*sets):
        rows = np.logical_and.reduce([known[k] == v for k, v in zip(keys, cell, strict=True)])
        values = known[measure][rows].to_numpy(float)
        if not values.size:
            raise InputError(
                f"{measure}: there must be finished runs of {_describe(names, cell)}, and there "
                f"are none; run them, or leave a level out with --where"
            )
        cells[cell] = values
    if max(map(len, cells.values()), default=0) < 2:
        raise InputError(
            f"{measure}: there must be replicates, but no treatment has two finished runs; run "
            f"them with other seeds"
        )
    return cells


def _describe(names: Sequence[str], cell: Cell) -> str:
    pairs = zip(names, cell, strict=True)
    return ", ".join(f"{describe_factor(name)} {level}" for name, level in pairs)


def list_tests(
    measure: str, cells: Mapping[Cell, Array], names: Sequence[str]
) -> Iterator[dict[str, object]]:
    """Yield the rows of ``TESTS`` of a measure: each factor, and the interaction of two."""
    values = np.concatenate(list(cells.values()))
    levels = {
        name: [cell[i] for cell, sample in cells.items() for _ in sample]
        for i, name in enumerate(names)
    }
    tests: list[EffectTest] = permute_effects(values, levels)
    for test, adjusted in zip(tests, holm([test.p for test in tests]), strict=True):
        effect = CROSS.join(test.effect)
        numbers = (test.freedom, test.error_freedom, test.f, test.p, adjusted)
        yield dict(zip(TESTS, (measure, effect, *numbers), strict=True))


def _describe_contrast(measure: str, contrast: Contrast) -> dict[str, object]:
    interval = contrast.interval
    cells = (measure, CROSS.join(contrast.effect), contrast.text, interval.value, interval.low)
    return dict(zip(EFFECTS, (*cells, interval.high), strict=True))


def conclude(tests: pd.DataFrame, effects: pd.DataFrame, label: str = FITNESS) -> Iterator[str]:
    """Yield a conclusion for each effect, with its differences; ``label`` names the fitness."""
    for row in tests.to_dict("records"):
        rows = effects[(effects.measure == row["measure"]) & (effects.effect == row["effect"])]
        shown = "; ".join(
            f"{_spell_contrast(r.contrast)}: {r.difference:.2f} [{r.low:.2f}, {r.high:.2f}]"
            for r in rows.itertuples()
        )
        verdict = "an effect" if row["p_holm"] < LEVEL else "no effect shown at the 5 % level"
        words = " and ".join(map(describe_factor, str(row["effect"]).split(CROSS)))
        kind = "interaction of " if CROSS in str(row["effect"]) else ""
        yield (
            f"{title_measure(str(row['measure']), label)}, {kind}{words}: {verdict}: "
            f"{format_p(row['p_holm'])} (Holm); differences of means with 95 % intervals: {shown}"
        )


def _spell_contrast(text: str) -> str:
    """Write the levels of a contrast as they are written in the figure."""
    return re.sub(r"\w+", lambda match: describe_level(match[0]), text)

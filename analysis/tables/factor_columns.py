"""Columns of factors: the levels of each row's treatment, in every table."""

import pandas as pd

from .study import Study

NAMING = ("treatment", "group", "run")
"""Columns that tell the treatment of a row; the first that a table has is used."""
SIDES = ("a", "b")
"""Columns of the two treatments of a comparison."""


def add_factors(table: pd.DataFrame, study: Study) -> pd.DataFrame:
    """Insert a column for each factor, with the level of the row's treatment, behind its name.

    A comparison of treatments ``a`` and ``b`` gets two, with these ends. A row of several
    treatments has an empty cell. If a table has such a column already, the factor's begins with
    ``factor_``.
    """
    records = (*study.evaluations, *study.records)  # if they share a label, runs count
    factors = list(dict.fromkeys(name for record in records for name in record.levels))
    columns = list(table.columns)
    named, ends = [name for name in NAMING if name in columns][:1], [""]
    if set(SIDES) <= set(columns):
        named, ends = list(SIDES), [f"_{side}" for side in SIDES]
    keys = {
        key: record.levels
        for record in records
        for key in ((record.name,) if named == ["run"] else (record.treatment,))
    }
    table = table.copy(deep=False)
    place = max((columns.index(name) for name in named), default=0) + 1
    for factor in factors:
        for column, end in zip(named, ends, strict=False):
            levels = [keys.get(str(key), {}).get(factor, "") for key in table[column]]
            if any(levels):
                taken = f"{factor}{end}" in table.columns
                table.insert(place, f"factor_{factor}{end}" if taken else f"{factor}{end}", levels)
                place += 1
    return table

"""The Jinja2 templates of the page, and tables as the templates show them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

WEB = Path(__file__).parent / "web"
_TEMPLATES = Environment(
    loader=FileSystemLoader(WEB),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def render(template: str, **values: Any) -> Markup:
    """Render a template of ``web/``; all values are escaped but ``Markup``."""
    return Markup(_TEMPLATES.get_template(template).render(values))


def read_asset(name: str) -> Markup:
    """Read a style or script of ``web/``, to be embedded as it is."""
    return Markup((WEB / name).read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Table:
    """A table with formatted cells."""

    columns: list[tuple[str, bool]]  # heading, and whether the column has numbers
    rows: list[tuple[str, ...]]


def format_table(frame: pd.DataFrame) -> Table:
    """Format the cells of a table; missing values are empty."""
    columns = [_format_column(frame[name]) for name in frame.columns]
    names = map(str, frame.columns)
    heads = [(name, numeric) for name, (numeric, _) in zip(names, columns, strict=True)]
    return Table(heads, list(zip(*(texts for _, texts in columns), strict=True)))


def _format_column(column: pd.Series) -> tuple[bool, list[str]]:
    """Return whether a column has numbers, and its cells, all with as many decimals."""
    values = column.to_numpy()
    if values.dtype.kind in "iu":
        return True, [str(value) for value in values]
    if values.dtype.kind != "f":
        known = column.astype(object).replace({True: "yes", False: "no"})
        return False, ["" if pd.isna(value) else str(value) for value in known]
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    decimals = max(0, 3 - math.floor(math.log10(sizes.max()))) if sizes.size else 0
    whole = bool(np.all(sizes == np.round(sizes)))
    form = ".0f" if whole else f".{decimals}f"
    if sizes.size and not whole and sizes.min() < 10.0**-decimals:
        form = ".3g"
    return True, ["" if math.isnan(value) else format(value, form) for value in values]

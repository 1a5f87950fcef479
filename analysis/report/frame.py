"""Pages that open in any browser offline: templates, tables and recorded missions."""

import base64
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from .playback import Json

_WEB = Path(__file__).parent / "web"
_TEMPLATES = Environment(
    loader=FileSystemLoader(_WEB),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
HEADER, LINKS, MISSIONS = "header", "links", "missions"  # ids of parts that are not sections


@dataclass(frozen=True)
class Page:
    """The content of a page.

    A playback has a ``label``, a ``key``, the names of the ``players`` that offer it, and the
    result of ``encode_shown`` as ``content``. Playbacks share ``grounds``.
    """

    title: str
    subtitle: str = ""
    sections: Mapping[str, Markup] = field(default_factory=dict)
    playbacks: Sequence[Json] = ()
    grounds: Mapping[str, Json] = field(default_factory=dict)


def render_parts(page: Page) -> dict[str, Markup]:
    """Render the elements of a page by id: header, links, sections and missions."""
    names = {name_section(name): name for name in page.sections}
    grounds = htmlsafe_json_dumps(page.grounds, separators=(",", ":"))
    return {
        HEADER: render("header.html", title=page.title, subtitle=page.subtitle),
        LINKS: render("links.html", names=names),
        **{key: render_section(name, page.sections[name]) for key, name in names.items()},
        MISSIONS: render("missions.html", playbacks=page.playbacks, grounds=grounds),
    }


def name_section(name: str) -> str:
    """Return the HTML id of a section."""
    return name.lower().replace(" ", "-")


def render_section(name: str, content: Markup) -> Markup:
    """Render a section of a page."""
    return render("frame.html", key=name_section(name), name=name, content=content)


def render_page(page: Page, scripts: Sequence[str]) -> bytes:
    """Render a page as the content of a file; ``scripts`` names files in ``web/``."""
    script = read_scripts(scripts)
    return assemble(page.title, render_parts(page), script, write_policy(script)).encode()


def assemble(
    title: str,
    parts: Mapping[str, Markup],
    script: Markup,
    policy: str,
    styles: Sequence[str] = ("style",),
) -> Markup:
    """Assemble a page from its rendered parts; ``styles`` names files in ``web/``."""
    sections = [part for key, part in parts.items() if key not in (HEADER, LINKS, MISSIONS)]
    style = Markup("").join(_read_asset(f"{name}.css") for name in styles)
    values = {"policy": policy, "title": title, "style": style, "script": script}
    return render("page.html", parts=parts, sections=sections, **values)


def read_scripts(names: Sequence[str]) -> Markup:
    """Read and join scripts in ``web/``."""
    return Markup("\n" + "".join(_read_asset(f"{name}.js") for name in names))


def write_policy(script: str, connect: str = "'none'") -> str:
    """Return a Content-Security-Policy that allows only this script."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        f"img-src data:; connect-src {connect}; base-uri 'none'; form-action 'none'"
    )


def render(template: str, **values: Any) -> Markup:
    """Render a template in ``web/``; all values except ``Markup`` are escaped."""
    return Markup(_TEMPLATES.get_template(template).render(values))


def _read_asset(name: str) -> Markup:
    return Markup((_WEB / name).read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Table:
    """A table with formatted cells."""

    columns: list[tuple[str, bool]]  # heading, and True for numbers
    rows: list[tuple[str, ...]]


def format_table(frame: pd.DataFrame) -> Table:
    """Format the cells of a table; missing values are empty."""
    columns = [_format_column(column) for _, column in frame.items()]
    names = map(str, frame.columns)
    heads = [(name, numeric) for name, (numeric, _) in zip(names, columns, strict=True)]
    return Table(heads, list(zip(*(texts for _, texts in columns), strict=True)))


def _format_column(column: pd.Series) -> tuple[bool, list[str]]:
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

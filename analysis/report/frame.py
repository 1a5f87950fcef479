"""Pages that any browser can open offline: templates, tables, sections with figures."""

import argparse
import base64
import hashlib
import logging
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError, single_line
from evoros.storage.figure_context import FigureContext
from evoros.terminal.log import LOGGER, withhold_messages

from ..designs.cones import outline_part, trace_cones
from ..drawing import style
from ..products import make_product
from ..subcommands import import_subcommand, parse
from ..tables.study import Study
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
    """The content of a page; its playbacks share ``grounds``.

    A playback has a ``label``, a ``key``, ``players``, and ``content`` from ``encode_shown``.
    """

    title: str
    subtitle: str = ""
    sections: Mapping[str, Markup] = field(default_factory=dict)
    playbacks: Sequence[Json] = ()
    grounds: Mapping[str, Json] = field(default_factory=dict)


def render_parts(page: Page) -> dict[str, Markup]:
    """Render the header, links, sections and missions of a page, by id."""
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
    """Render the file content of a page; ``scripts`` names files in ``web/``."""
    script = read_scripts(scripts)
    return assemble(page.title, render_parts(page), script, write_policy(script)).encode()


def assemble(
    title: str,
    parts: Mapping[str, Markup],
    script: Markup,
    policy: str,
    styles: Sequence[str] = ("style",),
) -> Markup:
    """Assemble a page from rendered parts; ``styles`` names files in ``web/``."""
    sections = [part for key, part in parts.items() if key not in (HEADER, LINKS, MISSIONS)]
    style = Markup("").join(_read_asset(f"{name}.css") for name in styles)
    values = {"policy": policy, "title": title, "style": style, "script": script}
    return render("page.html", parts=parts, sections=sections, **values)


def read_scripts(names: Sequence[str]) -> Markup:
    """Read and join scripts in ``web/``."""
    return Markup("\n" + "".join(_read_asset(f"{name}.js") for name in names))


def write_policy(script: str, connect: str = "'none'") -> str:
    """Return a Content-Security-Policy that permits only this script."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        f"img-src data:; connect-src {connect}; base-uri 'none'; form-action 'none'"
    )


def render(template: str, **values: Any) -> Markup:
    """Render a template in ``web/``, escaping all values that are not ``Markup``."""
    return Markup(_TEMPLATES.get_template(template).render(values))


def _read_asset(name: str) -> Markup:
    return Markup((_WEB / name).read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Table:
    """A table with formatted cells."""

    columns: list[tuple[str, bool]]  # column head, and whether the column holds numbers
    rows: list[tuple[str, ...]]


def format_table(frame: pd.DataFrame) -> Table:
    """Format the cells of a table; missing values become empty strings."""
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


MAX_SVG = 1_000_000  # maximum size [bytes] of an embedded SVG; larger figures are embedded as PNG
SCALE = 1.5  # magnification for screens, which are viewed from farther away than paper
_CSS_PER_IN, _PT_PER_IN = 96, 72
_OUTLINE = Markup(
    '<path d="{}" fill="{}" stroke="#000" stroke-width=".5" vector-effect="non-scaling-stroke"/>'
)
_NAMESPACE = re.compile(r"\{[^}]*\}")
MAX_ROWS = 400  # maximum number of table rows on the page; longer tables are omitted


FIGURE_OF_PAPER = re.compile(r" \([^()]*Figs?\. [^()]*\)")  # captions omit these
PAPER = "paper"  # value of ``--claims`` for the claims of the 2018 paper


@dataclass(frozen=True)
class Section:
    """A section of a page, or the reason for its absence."""

    name: str
    missing: str = ""  # why there is no content
    caption: str = ""
    picture: Markup | None = None
    messages: Sequence[str] = ()
    rows: int = 0  # number of rows in the table
    numbers: Table | None = None  # None if there is no table or it has too many rows
    left_out: Sequence[str] = ()

    def render(self, own_section: bool) -> Markup:
        """Render the section, with a heading if it is part of another section."""
        return render("section.html", section=self, own_section=own_section)


def make_section(name: str, study: Study, options: argparse.Namespace) -> Section:
    """Make a section from a subcommand with default options; errors affect only this section."""
    failure = ""
    with withhold_messages() as records:
        try:
            section = _make_section(name, study, options)
        except InputError as error:
            section = Section(name, missing=single_line(error))
        except Exception as error:
            failure = f"cannot be drawn ({type(error).__name__}: {single_line(error)})"
            section = Section(name, missing=f"This {failure}.")
    if failure:
        LOGGER.warning("%s: %s; left out", name, failure)
    left_out = [record.getMessage() for record in records if record.levelno >= logging.WARNING]
    return replace(section, left_out=list(dict.fromkeys(left_out)))


def _make_section(name: str, study: Study, options: argparse.Namespace) -> Section:
    module = import_subcommand(name)
    own_claims = name == "claims" and options.claims != PAPER
    more = ["--claims", options.claims] if own_claims else []
    chosen = parse([name, *map(str, options.folders), *more])
    chosen.output = options.output
    product = make_product(module, study, chosen)
    figure, table = product.figure, product.table
    rows = 0 if table is None else len(table)
    caption = FIGURE_OF_PAPER.sub("", module.HELP)
    return Section(
        name,
        caption=f"{caption[0].upper()}{caption[1:]}.",
        picture=None if figure is None else embed_figure(figure, name),
        messages=product.messages,
        rows=rows,
        numbers=None if table is None or rows > MAX_ROWS else format_table(table),
    )


def embed_figure(figure: Figure, name: str) -> Markup:
    """Return a figure as an ``svg`` element with prefixed ids or, if too large, as an ``img``."""
    svg = style.render(figure, "svg", as_text=True)  # text stays searchable
    if len(svg) <= MAX_SVG:
        return _inline_svg(svg, name)
    data = base64.b64encode(style.render(figure, "png")).decode()
    width = round(figure.get_figwidth() * _CSS_PER_IN * SCALE)
    image = Markup('<img alt="{}" width="{}" src="data:image/png;base64,{}">')
    return image.format(name, width, data)


def _inline_svg(svg: bytes, name: str) -> Markup:
    """Convert an SVG file to an HTML element without metadata; prefix ids with ``name``."""
    root = ElementTree.fromstring(svg)
    for parent in root.iter():
        for child in list(parent):
            if _strip_namespace(child.tag) in ("metadata", "style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = _strip_namespace(element.tag)
        attributes = {_strip_namespace(key): value for key, value in element.attrib.items()}
        element.attrib = {key: _prefix(key, value, name) for key, value in attributes.items()}
    width = float(root.attrib.pop("width").removesuffix("pt")) * _CSS_PER_IN / _PT_PER_IN * SCALE
    root.attrib.pop("height")
    root.attrib |= {"style": f"width:{width:.0f}px", "role": "img", "aria-label": name}
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _strip_namespace(name: str) -> str:
    return _NAMESPACE.sub("", name)


def _prefix(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    return value.replace("url(#", f"url(#{name}-")


def draw_outline(context: FigureContext) -> Markup:
    """Return the parts of a robot in top view as SVG elements."""
    return Markup("").join(
        _OUTLINE.format(_trace(outline_part(part)), "#595959" if part.wheel else "#f7f7f7")
        for part in sorted(context.parts, key=lambda part: part.top_m)
    )


def draw_sensors(sensors: pd.DataFrame, reach_m: float) -> Markup:
    """Return the cones and positions of sensors as SVG elements."""
    cones = "".join(_trace(cone) for cone in trace_cones(sensors, reach_m))
    dots = "".join(f"M{-y:.3f} {-x:.3f}h0" for x, y in sensors[["x_m", "y_m"]].to_numpy(float))
    return Markup('<path class="cone" d="{}"/><path class="dot" d="{}"/>').format(cones, dots)


def _trace(outline: Array) -> str:
    return "M" + "L".join(f"{-y:.3f} {-x:.3f}" for x, y in outline.tolist()) + "Z"

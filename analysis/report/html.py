"""Pieces of HTML: tables, lists and figures. All text that comes from folders is escaped here."""

import base64
import io
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..drawing.style import save

LARGEST = 1_000_000
"""Bytes of an SVG that is put into a page; a larger one becomes a PNG."""
ENLARGED = 1.5  # a screen is looked at from farther away than paper
_NAMESPACE = re.compile(r"\{[^}]*\}")


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text; ``kind`` is its class."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def bullets(lines: Iterable[str]) -> str:
    """A list of plain texts; nothing of none."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul class="said">{items}</ul>' if items else ""


def folded(title: str, content: str, unfolded: bool = False) -> str:
    """What is shown when its title is clicked."""
    return f"<details{' open' * unfolded}><summary>{escape(title)}</summary>{content}</details>"


def table(frame: pd.DataFrame) -> str:
    """A table that sorts by the column whose heading is clicked."""
    columns = [_column(frame[name]) for name in frame.columns]
    head = "".join(
        f'<th{_NUMBER * numeric} scope="col"><button type="button">{escape(name)}</button></th>'
        for name, (numeric, _) in zip(map(str, frame.columns), columns, strict=True)
    )
    cells = ([_cell(text, numeric) for text in texts] for numeric, texts in columns)
    rows = "".join(f"<tr>{''.join(row)}</tr>\n" for row in zip(*cells, strict=True))
    return (
        f'<div class="table" tabindex="0"><table class="sortable"><thead><tr>{head}</tr></thead>\n'
        f"<tbody>{rows}</tbody></table></div>"
    )


_NUMBER = ' class="number"'


def _cell(text: str, numeric: bool) -> str:
    return f"<td{_NUMBER * numeric}>{escape(text)}</td>"


def _column(column: pd.Series) -> tuple[bool, list[str]]:
    """Whether it has numbers, and its cells: numbers with as many decimals as give four digits."""
    values = column.to_numpy()
    if values.dtype.kind in "iu":
        return True, [str(value) for value in values]
    if values.dtype.kind != "f":
        return False, ["" if pd.isna(value) else _plain(value) for value in column]
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    decimals = max(0, 3 - math.floor(math.log10(sizes.max()))) if sizes.size else 0
    whole = bool(np.all(sizes == np.round(sizes)))
    form = ".0f" if whole else f".{decimals}f"
    if sizes.size and not whole and sizes.min() < 10.0**-decimals:
        form = ".3g"
    return True, ["" if math.isnan(value) else format(value, form) for value in values]


def _plain(value: object) -> str:
    return ("yes" if value else "no") if isinstance(value, bool | np.bool_) else str(value)


def picture(figure: Figure, name: str) -> str:
    """A figure as part of the page; ``name`` keeps its inner names apart from other figures'."""
    file = io.BytesIO()
    save(figure, file, "svg", as_text=True)  # to be found and copied, like the rest of the page
    if len(file.getvalue()) <= LARGEST:
        return f'<div class="paper">{inline(file.getvalue(), name)}</div>'
    file = io.BytesIO()
    save(figure, file, "png")
    data = base64.b64encode(file.getvalue()).decode()
    wide = round(figure.get_figwidth() * 96 * ENLARGED)
    source = f"data:image/png;base64,{data}"
    return f'<div class="paper"><img alt="{escape(name)}" width="{wide}" src="{source}"></div>'


def inline(svg: bytes, name: str) -> str:
    """An SVG file as an element of HTML: no namespaces, metadata and styles of its own.

    What it names, and refers to, begins with ``name``, so that figures do not use each other's.
    """
    root = ElementTree.fromstring(svg)
    for parent in root.iter():
        for child in list(parent):
            if _bare(child.tag) in ("metadata", "style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = _bare(element.tag)
        attributes = {_bare(key): value for key, value in element.attrib.items()}
        element.attrib = {key: _renamed(key, value, name) for key, value in attributes.items()}
    _size(root, name)
    return ElementTree.tostring(root, encoding="unicode")


def _bare(name: str) -> str:
    return _NAMESPACE.sub("", name)


def _renamed(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    return value.replace("url(#", f"url(#{name}-")


def _size(root: ElementTree.Element, name: str) -> None:
    """As wide as the page has room for, up to what suits a screen."""
    wide = float(root.attrib.pop("width").removesuffix("pt")) * 96 / 72 * ENLARGED
    root.attrib.pop("height")
    root.attrib |= {"style": f"width:{wide:.0f}px", "role": "img", "aria-label": name}


def listing(pairs: Sequence[tuple[str, ...]]) -> str:
    """A table of texts without headings; the first column says what the others are."""
    rows = "".join(
        f'<tr><th scope="row">{escape(first)}</th>'
        + "".join(f"<td>{escape(value)}</td>" for value in rest)
        + "</tr>\n"
        for first, *rest in pairs
    )
    return f'<div class="table"><table>{rows}</table></div>'

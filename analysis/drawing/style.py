"""The style of all figures: widths, fonts, colours, and reproducible files."""

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError, single_line
from evoros.files.resources import expand_home

from .finish import fit_text, letter, prepare_figure
from .png import DPI, write_png

COLUMN_IN = 3.5  # width of one column of a two-column page
PAGE_IN = 7.0  # width of both columns
FONT_PT = 8.0
STYLE: dict[Any, Any] = {
    "font.size": FONT_PT,  # all other sizes are relative to it
    "axes.titlesize": "medium",
    "legend.fontsize": "small",
    "legend.title_fontsize": "small",
    "text.parse_math": False,  # names of folders may contain a $
    "figure.autolayout": False,  # figures that are laid out stay as they are
    "figure.constrained_layout.use": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # embeds TrueType fonts, as most publishers require
    "svg.hashsalt": "evoros",  # otherwise the ids in an SVG are random
}
_OURS = ("savefig.", "backend", "figure.autolayout", "figure.constrained_layout", "text.")
"""Parameters that a style file does not change: formats, layout, and how text is read."""
_chosen: ContextVar[Mapping[Any, Any] | None] = ContextVar("chosen", default=None)
_DATES = {"svg": "Date", "pdf": "CreationDate"}

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILLION, PURPLE = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
"""The colours of Okabe and Ito (2008), which colour-blind readers can tell apart."""
CATEGORIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)
"""The order in which colours are assigned; the first also differ in grey."""


@contextmanager
def choose_style(name: str | None) -> Iterator[None]:
    """Draw and save with a matplotlib style meanwhile: a file, or one that matplotlib has.

    All sizes follow ``font.size``, and the width of ``figure.figsize`` is one column.

    Raises:
        InputError: there is no such style, or the file cannot be read.
    """
    parameters = {} if name is None else _read_style(name)
    token = _chosen.set(
        {key: parameters[key] for key in parameters if not str(key).startswith(_OURS)}
    )
    try:
        yield
    finally:
        _chosen.reset(token)


def _read_style(name: str) -> Mapping[Any, Any]:
    from matplotlib import style

    path = expand_home(Path(name))
    if name in style.library and not path.exists():
        return dict(style.library[name])
    try:
        # matplotlib would also look on the internet, and go on without a key that it does not know.
        for line in path.read_text().splitlines():
            key = line.partition("#")[0].partition(":")[0].strip()
            if key and key not in mpl.rcParams:
                raise InputError(
                    f"--style {name}: the key {key!r} is none of matplotlib's; correct or remove it"
                )
        return dict(mpl.rc_params_from_file(path, fail_on_error=True, use_default_template=False))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"--style: must be a matplotlib style file, or the name of one of its styles, not "
            f"{name} ({single_line(error)}); correct it"
        ) from error


@contextmanager
def use_style(more: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Give all that is made meanwhile the style of figures, and then the chosen one."""
    parameters: dict[Any, Any] = {**STYLE, **(_chosen.get() or {}), **(more or {})}
    with mpl.rc_context(parameters):
        yield


def scale_type(length: float) -> float:
    """Scale a length [in or pt] that holds text of ``FONT_PT`` to the size of the style."""
    return length * float(_find("font.size", FONT_PT)) / FONT_PT


def _find(key: str, default: Any) -> Any:
    return (_chosen.get() or {}).get(key, default)


def figure_width(columns: int | None, default: int = 1) -> float:
    """Return the width [in] of a figure over one or two columns of a page."""
    width = float(_find("figure.figsize", (COLUMN_IN, 0.0))[0])
    return width if (columns or default) == 1 else width * PAGE_IN / COLUMN_IN


def is_wide(width: float) -> bool:
    """Whether a figure of a width [in] is rather as wide as a page than as a column."""
    return width > (COLUMN_IN + PAGE_IN) / 2


def assign_colours(treatments: Sequence[str]) -> dict[str, str]:
    """Assign a colour to each treatment, the same in all figures of a study."""
    names = dict.fromkeys(treatments)
    return {name: CATEGORIES[i % len(CATEGORIES)] for i, name in enumerate(names)}


def abbreviate(names: Sequence[str], length: int) -> dict[str, str]:
    """Map names to themselves or, if one is longer, to letters."""
    fit = max(map(len, names)) <= length
    return {name: name if fit else letter(i) for i, name in enumerate(names)}


def scatter_aside(count: int) -> Array:
    """Return places (count,) from -0.5 to 0.5, of which neighbours are apart."""
    return np.asarray(np.arange(count) * 0.6180339887498949 % 1 - 0.5)


def save(
    figure: Figure,
    file: Path | str | IO[bytes],
    kind: str = "svg",
    as_text: bool = False,
    letters: str = "",
) -> None:
    """Write a figure as ``svg``, ``pdf`` or ``png``; equal figures give equal bytes.

    With ``as_text``, an SVG has text in the viewer's fonts. ``letters`` names the panels, and the
    first one so: ``A``, ``a`` or ``(a)``.
    """
    metadata = {_DATES[kind]: None} if kind in _DATES else {}
    finish(figure, letters)
    with use_style({"svg.fonttype": "none" if as_text else "path"}):
        if kind == "png":
            write_png(figure, file)
        else:
            figure.savefig(file, format=kind, metadata=metadata, dpi=DPI)


def finish(figure: Figure, letters: str = "") -> None:
    """Lay a figure out and make its text fit, as ``save`` does before it writes."""
    with use_style():
        prepare_figure(figure, letters)
        _fix_layout(figure)
        fit_text(figure)


def render(figure: Figure, kind: str, as_text: bool = False, letters: str = "") -> bytes:
    """Return the content of a figure's file; see ``save``."""
    picture = io.BytesIO()
    save(figure, picture, kind, as_text, letters)
    return picture.getvalue()


def _fix_layout(figure: Figure) -> None:
    """Compute the layout and round it, because the solver's last digits vary from call to call."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)  # not "none", with which savefig would draw it once more
    parts = [*figure.subfigs]
    for part in parts:
        parts += part.subfigs
        part.bbox_relative.set_points(np.round(part.bbox_relative.get_points(), 4))
    for axes in figure.axes:
        x, y, width, height = np.round(axes.get_position(original=True).bounds, 4).tolist()
        axes.set_position((x, y, width, height))

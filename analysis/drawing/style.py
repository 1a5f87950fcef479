"""The style of all figures: widths, fonts, colours, line wrapping, reproducible files."""

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from PIL import Image, ImageChops, ImageStat

from evoros.base.arrays import Array
from evoros.base.errors import InputError, single_line
from evoros.files.resources import expand_home

from .finish import fit_text, letter, prepare_figure

_DPI = 300
COLOURS = 256
VISIBLE = 0.1  # mean error, in steps of 1/255, above which a palette is not used
COLUMN_IN = 3.5  # width of a column on a two-column page
PAGE_IN = 7.0  # width of a two-column page
FONT_PT = 8.0
STYLE: dict[Any, Any] = {
    "font.size": FONT_PT,  # base of all other font sizes
    "axes.titlesize": "medium",
    "legend.fontsize": "small",
    "legend.title_fontsize": "small",
    "text.parse_math": False,  # folder names may contain a $
    "figure.autolayout": False,  # would change finished layouts
    "figure.constrained_layout.use": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # embeds TrueType fonts, as most publishers require
    "svg.hashsalt": "evoros",  # otherwise, SVG ids are random
}
# Prefixes of settings that a style file cannot change; nor can it change colours, which suit a
# light page.
_OURS = ("savefig.", "backend", "figure.autolayout", "figure.constrained_layout", "text.")
_chosen: ContextVar[Mapping[Any, Any] | None] = ContextVar("chosen", default=None)
_DATES = {"svg": "Date", "pdf": "CreationDate"}

# colours of Okabe and Ito (2008), which colour-blind readers can distinguish
BLACK, ORANGE, SKY, GREEN = "#000000", "#e69f00", "#56b4e9", "#009e73"
YELLOW, BLUE, VERMILLION, PURPLE = "#f0e442", "#0072b2", "#d55e00", "#cc79a7"
HALO = withStroke(linewidth=1.5, foreground="white")
DASHES: Sequence[Any] = ("-", (0, (4, 1)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (8, 1.5)))
CATEGORIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, YELLOW)


@contextmanager
def choose_style(name: str | None) -> Iterator[None]:
    """Apply a matplotlib style, given by file or name, inside the context."""
    parameters = {} if name is None else _read_style(name)
    token = _chosen.set(
        {
            key: parameters[key]
            for key in parameters
            if not (str(key).startswith(_OURS) or str(key).endswith("color"))
        }
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
        # Matplotlib would also search the internet, and ignore unknown keys.
        for line in path.read_text().splitlines():
            key = line.partition("#")[0].partition(":")[0].strip()
            if key and key not in mpl.rcParams:
                raise InputError(f"--style {name}: matplotlib has no key {key!r}; remove the line")
        return dict(mpl.rc_params_from_file(path, fail_on_error=True, use_default_template=False))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"--style: {name} is neither a matplotlib style file nor the name of a style "
            f"({single_line(error)}); correct the file or the name"
        ) from error


@contextmanager
def use_style(more: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Apply the default figure style, then the selected style, inside the context."""
    parameters: dict[Any, Any] = {**STYLE, **(_chosen.get() or {}), **(more or {})}
    with mpl.rc_context(parameters):
        yield


def scale_type(length: float) -> float:
    """Scale a length [in or pt] designed for ``FONT_PT`` to the font size of the style."""
    return length * float(_find("font.size", FONT_PT)) / FONT_PT


def _find(key: str, default: Any) -> Any:
    return (_chosen.get() or {}).get(key, default)


def figure_width(columns: int | None, default: int = 1) -> float:
    """Return the width [in] of a figure that spans one or two page columns."""
    width = float(_find("figure.figsize", (COLUMN_IN, 0.0))[0])
    return width if (columns or default) == 1 else width * PAGE_IN / COLUMN_IN


def is_wide(width: float) -> bool:
    """Return True if a width [in] is closer to a page width than to a column width."""
    return width > (COLUMN_IN + PAGE_IN) / 2


def assign_colours(treatments: Sequence[str]) -> dict[str, str]:
    """Assign a colour to each treatment, consistent across the figures of a study."""
    names = dict.fromkeys(treatments)
    return {name: CATEGORIES[i % len(CATEGORIES)] for i, name in enumerate(names)}


def assign_dashes(treatments: Sequence[str]) -> dict[str, tuple[str, Any]]:
    """Assign a colour to each treatment, with a dash pattern that is distinct in greyscale."""
    colours = assign_colours(treatments)
    return {name: (colours[name], DASHES[i % len(DASHES)]) for i, name in enumerate(colours)}


def abbreviate(names: Sequence[str], length: int) -> dict[str, str]:
    """Map each name to itself, or all names to letters if any is longer than ``length``."""
    fit = max(map(len, names)) <= length
    return {name: name if fit else letter(i) for i, name in enumerate(names)}


def scatter_aside(count: int) -> Array:
    """Return offsets (count,) from -0.5 to 0.5 that separate neighbouring dots."""
    return np.asarray(np.arange(count) * 0.6180339887498949 % 1 - 0.5)


def save(
    figure: Figure,
    file: Path | str | IO[bytes],
    kind: str = "svg",
    as_text: bool = False,
    letters: str = "",
) -> None:
    """Write a figure as ``svg``, ``pdf`` or ``png``; equal figures give equal bytes.

    With ``as_text``, an SVG contains text to be shown in the viewer's fonts. ``letters`` is the
    letter of the first panel: ``A``, ``a`` or ``(a)``.
    """
    metadata = {_DATES[kind]: None} if kind in _DATES else {}
    finish(figure, letters)
    with use_style({"svg.fonttype": "none" if as_text else "path"}):
        if kind == "png":
            write_png(figure, file)
        else:
            figure.savefig(file, format=kind, metadata=metadata, dpi=_DPI)


def finish(figure: Figure, letters: str = "") -> None:
    """Lay out a figure and fit its text, as ``save`` does before writing."""
    with use_style():
        prepare_figure(figure, letters)
        _fix_layout(figure)
        fit_text(figure)


def render(figure: Figure, kind: str, as_text: bool = False, letters: str = "") -> bytes:
    """Return the content of a figure file; see ``save``."""
    picture = BytesIO()
    save(figure, picture, kind, as_text, letters)
    return picture.getvalue()


def _fix_layout(figure: Figure) -> None:
    """Compute the layout and round it, because the solver's last digits vary between calls."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)  # "none" would make savefig draw the figure again
    parts = [*figure.subfigs]
    for part in parts:
        parts += part.subfigs
        part.bbox_relative.set_points(np.round(part.bbox_relative.get_points(), 4))
    for axes in figure.axes:
        x, y, width, height = np.round(axes.get_position(original=True).bounds, 4).tolist()
        axes.set_position((x, y, width, height))


def write_png(figure: Figure, file: Path | str | IO[bytes], dpi: float = _DPI) -> None:
    """Write a figure, with a palette of 256 colours if accurate enough."""
    whole = BytesIO()
    figure.savefig(whole, format="rgba", dpi=dpi)  # avoids compressing twice
    width, height = (int(length * dpi) for length in figure.get_size_inches())
    save_png(Image.frombytes("RGBA", (width, height), whole.getbuffer()), file, dpi)


def save_png(picture: Image.Image, file: Path | str | IO[bytes], dpi: float = _DPI) -> None:
    """Write a picture, with a palette of 256 colours if it is opaque and stays accurate enough."""
    chosen = picture
    if picture.convert("RGBA").getchannel("A").getextrema()[0] == 255:
        opaque = picture.convert("RGB")
        small = opaque.quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        errors = ImageChops.difference(small.convert("RGB"), opaque)  # needs little memory
        chosen = opaque if np.mean(ImageStat.Stat(errors).mean) > VISIBLE else small
    chosen.save(file, "PNG", optimize=True, dpi=(dpi, dpi))


def wrap_lines(text: str, room: float, minimum: int = 8) -> list[str]:
    """Split a string between words into lines of at most ``room`` characters."""
    words = text.replace("_", " ")
    return textwrap.wrap(
        words, max(minimum, int(room)), break_long_words=False, break_on_hyphens=False
    ) or [""]


def wrap(text: str, room: float, minimum: int = 8) -> str:
    """Wrap a string with ``wrap_lines``, and join the lines with newlines."""
    return "\n".join(wrap_lines(text, room, minimum))


def cut_short(text: str, length: int) -> str:
    """Shorten a string to ``length`` characters, with an ellipsis."""
    return text if len(text) <= length else text[: length - 3] + "..."


def wrap_all(lines: Iterable[str], room: float, minimum: int = 8) -> str:
    """Wrap each of several lines with ``wrap``, and join them."""
    return "\n".join(wrap(line, room, minimum) for line in lines)

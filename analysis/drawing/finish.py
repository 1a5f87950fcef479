"""Final steps of each figure: panel letters, complete markers, and labels that fit."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedFormatter, MaxNLocator
from matplotlib.transforms import Bbox

from evoros.base.arrays import Array

LETTERS = ("A", "a", "(a)")  # styles of panel letters, named after the first letter
_GAP_PT = 2.0  # minimum gap [pt] between tick labels
_ROUNDS = 8  # maximum number of attempts to thin out ticks
_LETTERED = "lettered"  # group id of figures that have panel letters
COLOUR_BAR = "<colorbar>"  # label that matplotlib gives the axes of a colour bar


def prepare_figure(figure: Figure, letters: str = "") -> None:
    """Prepare a figure for layout; ``letters`` is one of ``LETTERS``, or empty."""
    if letters and figure.get_gid() != _LETTERED:
        _add_letters(figure, letters)
        figure.set_gid(_LETTERED)  # prevents a second set of letters
    for axes in figure.axes:
        _keep_marks_whole(axes)
        _spell_names(axes)
    for part in [figure, *figure.findobj(SubFigure)]:
        for legend in part.legends:
            _spell([*legend.get_texts(), legend.get_title()])


def fit_text(figure: Figure) -> None:
    """Align panels, and fit ticks and notes so that no texts overlap in a fixed layout."""
    _align_panels(figure)
    _thin_ticks(figure)
    _part_numbers(figure)


def list_panels(figure: Figure) -> list[Axes]:
    """List the axes that are panels, not colour bars, twin axes or pictures."""
    panels: list[Axes] = []
    for axes in figure.axes:
        twin = any(_coincide(axes.bbox.bounds, other.bbox.bounds) for other in panels)
        shown = axes.axison and axes.get_visible() and axes.get_label() != COLOUR_BAR
        if shown and not twin:
            panels.append(axes)
    return panels


def _coincide(one: Sequence[float], other: Sequence[float]) -> bool:
    pairs = zip(one, other, strict=True)
    return all(math.isclose(*pair, rel_tol=1e-5, abs_tol=1e-8) for pair in pairs)


def _add_letters(figure: Figure, first: str) -> None:
    panels = _sort(list_panels(figure))
    for i, axes in enumerate(panels if len(panels) > 1 else []):
        name = letter(i)
        name = first.replace("A", name).replace("a", name.lower())
        middle, left, _ = _find_titles(axes)
        if left.get_text():
            left.set_text(f"{name}  {left.get_text()}")
            continue
        title = middle.get_text()
        axes.set_title(name + "\n" * title.count("\n"), loc="left", weight="bold")
        boxes = middle.get_window_extent(), left.get_window_extent()
        if title and _overlap(*boxes, _GAP_PT):
            middle.set_text("")
            axes.set_title(f"{name}  {title}", loc="left", weight="normal")


def letter(index: int) -> str:
    """Return the letter for an index: A to Z, AA, BB, and so on."""
    return chr(ord("A") + index % 26) * (1 + index // 26)


def _find_titles(axes: Axes) -> list[Text]:
    texts = {*axes.texts}
    return [part for part in axes.get_children() if isinstance(part, Text) and part not in texts]


def _sort(panels: Sequence[Axes]) -> list[Axes]:
    rows: list[list[Axes]] = []
    for axes in sorted(panels, key=lambda axes: -axes.get_position().y1):
        top = axes.get_position().y1
        if rows and abs(rows[-1][0].get_position().y1 - top) < 0.25 * axes.get_position().height:
            rows[-1].append(axes)
        else:
            rows.append([axes])
    return [axes for row in rows for axes in sorted(row, key=lambda axes: axes.get_position().x0)]


def _spell_names(axes: Axes) -> None:
    _spell([*_find_titles(axes), axes.xaxis.label, axes.yaxis.label])
    for axis in (axes.xaxis, axes.yaxis):
        formatter = axis.get_major_formatter()
        if isinstance(formatter, FixedFormatter):
            formatter.seq = [str(text).replace("_", " ") for text in formatter.seq]
    if axes.legend_ is not None:
        _spell([*axes.legend_.get_texts(), axes.legend_.get_title()])


def _spell(texts: Iterable[Text]) -> None:
    for text in texts:
        text.set_text(text.get_text().replace("_", " "))


def _keep_marks_whole(axes: Axes) -> None:
    for artist in axes.get_children():
        places = find_marks(artist, axes)
        if places is not None and len(places) and _within(places, axes):
            artist.set_clip_on(False)


def find_marks(artist: Artist, axes: Axes) -> Array | None:
    """Return the positions (n, 2) of an artist's markers; None if it has none in data units."""
    if isinstance(artist, PathCollection) and artist.get_offset_transform() == axes.transData:
        return _fill(artist.get_offsets())
    if isinstance(artist, Line2D) and artist.get_transform() == axes.transData:
        marked = artist.get_marker() not in ("None", "none", "", " ", None)
        return _fill(artist.get_xydata()) if marked else None
    return None


def _fill(places: Any) -> Array:
    return np.ma.filled(np.ma.asarray(places, dtype=np.float64), np.nan)


def _within(places: Array, axes: Axes) -> bool:
    limits = np.sort([axes.get_xlim(), axes.get_ylim()], axis=1)
    slack = 1e-9 * np.ptp(limits, axis=1)
    known = places[np.isfinite(places).all(axis=1)]
    inside = (known >= limits[:, 0] - slack) & (known <= limits[:, 1] + slack)
    return bool(inside.all())


def _align_panels(figure: Figure) -> None:
    """Align the left edges of panels in a column; subfigures have separate layouts."""
    columns: dict[int, list[Axes]] = {}
    for axes in list_panels(figure):
        if axes.get_aspect() == "auto":
            columns.setdefault(round(axes.bbox.x1), []).append(axes)
    for column in columns.values():
        left = max(axes.bbox.x0 for axes in column)
        for axes in column:
            x, y, width, height = axes.get_position(original=True).bounds
            inset = (left - axes.bbox.x0) / axes.bbox.width * width
            if inset < 0.15 * width:
                axes.set_position((x + inset, y, width - inset, height))


def _thin_ticks(figure: Figure) -> None:
    figure.draw_without_rendering()
    axes = list(_number_axes(figure))
    for _ in range(_ROUNDS):
        axes = [axis for axis in axes if collide(list_tick_labels(axis))]
        for axis in axes:
            fewer = max(2, len(list_tick_labels(axis)) - 2)
            axis.set_major_locator(MaxNLocator(fewer, steps=[1, 2, 5, 10]))
            axis.get_tightbbox()  # places the labels


def _part_numbers(figure: Figure) -> None:
    for axes in figure.axes:
        texts = [text for text in axes.texts if text.get_visible() and text.get_text()]
        for note in texts:
            if isinstance(note, Annotation) and note.anncoords == "offset points":
                _move(note, [text for text in texts if text is not note])


def _move(note: Annotation, others: Sequence[Text]) -> None:
    x, y = note.xyann
    sides = ((x, y), (x, -y - 7.0), (-x - 5.0, y), (-x - 5.0, -y - 7.0), (x + 8.0, y), (x, y + 8.0))
    for place in sides:
        note.xyann = place
        box = note.get_window_extent()
        if not any(_overlap(box, other.get_window_extent(), 1.0) for other in others):
            return
    note.xyann = x, y


def _number_axes(figure: Figure) -> Iterator[Axis]:
    for axes in figure.axes:
        if axes.axison and axes.get_visible():
            for axis in (axes.xaxis, axes.yaxis):
                if axis.get_visible() and isinstance(axis.get_major_locator(), MaxNLocator):
                    yield axis


def list_tick_labels(axis: Axis) -> list[Text]:
    """List the visible tick labels of an axis."""
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    return [
        label
        for tick in axis.get_major_ticks()
        if low - slack <= tick.get_loc() <= high + slack
        for label in (tick.label1, tick.label2)
        if label.get_visible() and label.get_text()
    ]


def collide(labels: Iterable[Text], gap_pt: float = _GAP_PT) -> bool:
    """Return True if two neighbouring labels are closer than ``gap_pt``."""
    boxes = [label.get_window_extent() for label in labels]
    return any(_overlap(a, b, gap_pt) for a, b in pairwise(boxes))


def _overlap(a: Bbox, b: Bbox, gap: float) -> bool:
    apart_x = a.x1 + gap <= b.x0 or b.x1 + gap <= a.x0
    apart_y = a.y1 <= b.y0 or b.y1 <= a.y0
    return not (apart_x or apart_y)

"""Faults of figures: violations of what readers may expect of any figure."""

import re
from collections.abc import Iterator
from itertools import combinations

from helpers import texts
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure, SubFigure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from evoros.analysis.drawing.finish import collide, find_marks, list_panels, list_tick_labels

SLACK_PX = 1.0


def find_faults(figure: Figure) -> list[str]:
    """Draw a figure that is finished, and list what is wrong with it."""
    figure.draw_without_rendering()
    return [
        *_find_colliding_ticks(figure),
        *_find_misaligned_panels(figure),
        *_find_text_outside(figure),
        *_find_text_on_text(figure),
        *_find_code_names(figure),
        *_find_cut_marks(figure),
        *_find_unfounded_legends(figure),
    ]


def _find_colliding_ticks(figure: Figure) -> Iterator[str]:
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if axes.axison and collide(list_tick_labels(axis), gap_pt=0.5):
                yield f"ticks collide: {[label.get_text() for label in list_tick_labels(axis)]}"


def _find_misaligned_panels(figure: Figure) -> Iterator[str]:
    """Panels with one right edge also have one left edge, unless one is much narrower."""
    boxes = [axes.bbox for axes in list_panels(figure) if axes.get_aspect() == "auto"]
    for a, b in combinations(boxes, 2):
        gap = abs(a.x0 - b.x0)
        if abs(a.x1 - b.x1) < SLACK_PX and SLACK_PX < gap < 0.1 * a.width:
            yield f"left edges of panels differ by {gap:.1f} px"


def _find_text_outside(figure: Figure) -> Iterator[str]:
    page = figure.bbox
    for text in _list_texts(figure):
        box = text.get_window_extent()
        outside = (page.x0 - box.x0, page.y0 - box.y0, box.x1 - page.x1, box.y1 - page.y1)
        if max(outside) > SLACK_PX:
            yield f"outside the figure by {max(outside):.1f} px: {text.get_text()!r}"


def _find_text_on_text(figure: Figure) -> Iterator[str]:
    placed = [(text, text.get_window_extent()) for text in _list_texts(figure)]
    for (a, box_a), (b, box_b) in combinations(placed, 2):
        wide = min(box_a.x1, box_b.x1) - max(box_a.x0, box_b.x0)
        high = min(box_a.y1, box_b.y1) - max(box_a.y0, box_b.y0)
        if wide > 1.5 and high > 0.3 * min(box_a.height, box_b.height):
            yield f"text on text: {a.get_text()!r} and {b.get_text()!r}"


def _list_texts(figure: Figure) -> list[Text]:
    hidden = {
        id(text)
        for axes in figure.axes
        if not axes.axison
        for axis in (axes.xaxis, axes.yaxis)
        for text in axis.findobj(Text)
    }
    return [
        t for t in texts(figure) if t.get_visible() and id(t) not in hidden and t.get_text().strip()
    ]


def _find_code_names(figure: Figure) -> Iterator[str]:
    for text in _list_texts(figure):
        if re.search(r"\w_\w", text.get_text()) and "=" not in text.get_text():
            yield f"a code name: {text.get_text()!r}"


def _find_cut_marks(figure: Figure) -> Iterator[str]:
    """Marks within an axes, or on its edge, are whole."""
    for axes in figure.axes:
        for artist in axes.get_children():
            places = find_marks(artist, axes)
            if places is None:
                continue
            box = axes.bbox.padded(-2.0)
            for x, y in axes.transData.transform(places):
                near = axes.bbox.padded(0.5).contains(x, y) and not box.contains(x, y)
                if near and artist.get_clip_on():
                    yield f"a mark is cut at ({x:.0f}, {y:.0f}) of {axes.get_title()!r}"
                    break


def _find_unfounded_legends(figure: Figure) -> Iterator[str]:
    """Each entry has the colour, or the mark, of something that is drawn."""
    drawn = _list_colours(figure)
    for legend in _list_legends(figure):
        for handle, label in zip(legend.legend_handles, legend.get_texts(), strict=True):
            if handle is not None and not _looks(handle) & drawn:
                yield f"nothing is drawn as the legend's {label.get_text()!r}"


def _list_legends(figure: Figure) -> list[Legend]:
    parts: list[Figure | SubFigure] = [figure, *figure.findobj(SubFigure)]
    legends = [legend for part in parts for legend in part.legends]
    return [*legends, *(axes.legend_ for axes in figure.axes if axes.legend_ is not None)]


def _list_colours(figure: Figure) -> set[tuple[object, ...]]:
    return {
        look
        for axes in figure.axes
        for artist in axes.get_children()
        if artist.get_visible()
        for look in _looks(artist)
    }


def _looks(artist: object) -> set[tuple[object, ...]]:
    """The colours of an artist, without their transparency, and its marks."""
    if isinstance(artist, Line2D):
        mark = artist.get_marker()
        if mark not in ("None", "", None):
            faces = [artist.get_markerfacecolor(), artist.get_markeredgecolor()]
            marks = {("mark", str(mark), *_rgb(face)) for face in faces}
            return marks | {("colour", *_rgb(face)) for face in faces}
        return {("colour", *_rgb(artist.get_color()))}
    colours = []
    for name in ("get_facecolor", "get_edgecolor"):
        getter = getattr(artist, name, None)
        if getter is not None and not isinstance(artist, Axes | Text):
            value = getter()
            colours += [value] if isinstance(artist, Patch) else list(value)
    return {("colour", *_rgb(colour)) for colour in colours}


def _rgb(colour: object) -> tuple[float, ...]:
    try:
        return tuple(round(part, 2) for part in to_rgba(colour)[:3])  # type: ignore[arg-type]
    except (ValueError, TypeError):
        return ()

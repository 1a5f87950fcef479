"""Figures and designs as elements of an HTML page."""

import base64
import re
from xml.etree import ElementTree

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..designs.cones import outline_part, trace_cones
from ..drawing.style import render

MAX_SVG = 1_000_000
"""Maximum size in bytes of an embedded SVG; larger figures become PNGs."""
SCALE = 1.5  # enlargement for screens, which are farther away than paper
_CSS_PER_IN, _PT_PER_IN = 96, 72
_OUTLINE = Markup(
    '<path d="{}" fill="{}" stroke="#000" stroke-width=".5" vector-effect="non-scaling-stroke"/>'
)
_NAMESPACE = re.compile(r"\{[^}]*\}")


def embed_figure(figure: Figure, name: str) -> Markup:
    """Return a figure as an ``svg`` with ids of its name, or as an ``img`` if it is large."""
    svg = render(figure, "svg", as_text=True)  # so that its text can be searched and copied
    if len(svg) <= MAX_SVG:
        return inline_svg(svg, name)
    data = base64.b64encode(render(figure, "png")).decode()
    width = round(figure.get_figwidth() * _CSS_PER_IN * SCALE)
    image = Markup('<img alt="{}" width="{}" src="data:image/png;base64,{}">')
    return image.format(name, width, data)


def inline_svg(svg: bytes, name: str) -> Markup:
    """Convert an SVG file to an element of HTML whose ids begin with ``name``, without metadata."""
    root = ElementTree.fromstring(svg)
    for parent in root.iter():
        for child in list(parent):
            if _strip_namespace(child.tag) in ("metadata", "style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = _strip_namespace(element.tag)
        attributes = {_strip_namespace(key): value for key, value in element.attrib.items()}
        element.attrib = {key: _prefix(key, value, name) for key, value in attributes.items()}
    _set_width(root, name)
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _strip_namespace(name: str) -> str:
    return _NAMESPACE.sub("", name)


def _prefix(key: str, value: str, name: str) -> str:
    """Prefix ids and references to them."""
    if key == "id":
        return f"{name}-{value}"
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    return value.replace("url(#", f"url(#{name}-")


def _set_width(root: ElementTree.Element, name: str) -> None:
    """Set the width on a screen; the page limits it to the available room."""
    points = float(root.attrib.pop("width").removesuffix("pt"))
    width = points * _CSS_PER_IN / _PT_PER_IN * SCALE
    root.attrib.pop("height")
    root.attrib |= {"style": f"width:{width:.0f}px", "role": "img", "aria-label": name}


def draw_outline(context: FigureContext) -> Markup:
    """Return the parts of a robot from above, as elements of SVG."""
    return Markup("").join(
        _OUTLINE.format(_trace(outline_part(part)), "#595959" if part.wheel else "#f7f7f7")
        for part in sorted(context.parts, key=lambda part: part.top_m)
    )


def draw_sensors(sensors: pd.DataFrame, reach_m: float) -> Markup:
    """Return the cones and the places of sensors, as elements of SVG."""
    cones = "".join(_trace(cone) for cone in trace_cones(sensors, reach_m))
    dots = "".join(f"M{-y:.3f} {-x:.3f}h0" for x, y in sensors[["x_m", "y_m"]].to_numpy(float))
    return Markup('<path class="cone" d="{}"/><path class="dot" d="{}"/>').format(cones, dots)


def _trace(outline: Array) -> str:
    """Return the path of a polygon in the robot's frame: nose up, left on the left."""
    return "M" + "L".join(f"{-y:.3f} {-x:.3f}" for x, y in outline.tolist()) + "Z"

"""Reads the elements of a URDF that are for Gazebo: plugins and the friction of links."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from lxml.etree import _Element as Element

from evoros.formats.strict_xml import element_error
from evoros.formats.urdf.parts import parse_numbers

_COEFFICIENTS = ("mu", "mu1", "mu2")


@dataclass(frozen=True)
class Plugin:
    """A plugin of Gazebo: its file and its class, and the texts of its children by their tags."""

    name: str
    texts: Mapping[str, tuple[str, ...]]


class FrictionAxis(NamedTuple):
    """The direction in which a link has its first coefficient of friction."""

    direction: tuple[float, ...]  # x, y, z
    frame: str  # the link whose frame it is in; empty: the frame of the link itself


def read_plugins(robot: Element) -> tuple[Plugin, ...]:
    """Read all plugins of a ``<robot>``."""
    plugins = []
    for plugin in robot.iterfind("gazebo//plugin"):
        texts: dict[str, tuple[str, ...]] = {}
        for child in plugin:
            if isinstance(child.tag, str) and child.text and child.text.strip():
                texts[child.tag] = (*texts.get(child.tag, ()), child.text.strip())
        name = f"{plugin.get('filename', '')} {plugin.get('name', '')}"
        plugins.append(Plugin(name, texts))
    return tuple(plugins)


def read_friction_axes(robot: Element) -> dict[str, FrictionAxis]:
    """Read ``<fdir1>`` of the links that have one, and check the coefficients of all."""
    axes = {}
    for gazebo in robot.iterfind("gazebo[@reference]"):
        for element in (child for tag in _COEFFICIENTS for child in gazebo.iter(tag)):
            if parse_numbers(element, _read_text(element), 1)[0] < 0.0:
                problem = f"must be at least 0, not {_read_text(element)}"
                raise element_error(element, problem, "write a coefficient of friction from 0 up")
        for element in gazebo.iter("fdir1"):
            frames = [v for name, v in element.attrib.items() if str(name).endswith("expressed_in")]
            numbers = parse_numbers(element, _read_text(element), 3)
            frame = str((*frames, "")[0])
            axes[str(gazebo.get("reference"))] = FrictionAxis(tuple(numbers), frame)
    return axes


def _read_text(element: Element) -> str:
    """Return the attribute ``value`` or the text, as Gazebo does."""
    return str(element.get("value") or element.text or "").strip()

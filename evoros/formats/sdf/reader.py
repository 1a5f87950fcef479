"""Reads the bodies of an SDF file (versions 1.4 to 1.11): a ``<world>``, or models alone.

Every element is used, on the list of what cannot matter here (see ``evoros.formats.sdf.elements``),
reported as a warning of the logger ``evoros.sdf``, or an error; none is dropped in silence.

A ``<state>`` moves models and links to world poses, as Gazebo writes and reads it. Links that
fixed joints join are one body. A link without mass has 1 kg, SDF's default.
"""

import re
from collections.abc import Iterator

from lxml.etree import _Element as Element

from evoros.formats.sdf.elements import LOG, check_children, report
from evoros.formats.sdf.frames import Frames, Path, read_pose
from evoros.formats.sdf.links import Link, fixed_bodies, movable_body, read_link
from evoros.formats.strict_xml import (
    child,
    fault,
    flag,
    local_tag,
    name_of,
    needed,
    numbers,
    parse,
    shown,
    text_of,
    warn,
)
from evoros.geometry.shapes import Body


def read_sdf(content: bytes, source: str) -> tuple[Body, ...]:
    """The bodies of a file's content, in its order; ``source`` is its name in errors.

    Raises:
        InputError: what cannot be read or not be simulated, with file, line and element.
    """
    root = parse(content, source)
    if root.tag != "sdf":
        raise fault(root, "must be <sdf>", "give a file in SDF, version 1.4 to 1.11")
    version = re.fullmatch(r"1\.([0-9]{1,2})", root.get("version", "").strip())
    if version is None or not 4 <= int(version[1]) <= 11:
        given = shown(root.get("version", ""))
        raise fault(root, f"must have a version from 1.4 to 1.11, not {given}", "convert the file")
    check_children(root)
    worlds = root.findall("world")
    if len(worlds) > 1 or (worlds and root.find("model") is not None):
        raise fault(worlds[-1], "must be alone in its file", "keep one <world>, or models only")
    container = worlds[0] if worlds else root
    if worlds:
        _check_world(container)
    frames = Frames(container)
    for state in container.findall("state"):
        check_children(state)
        _apply_state(state, (), frames)
    frames.check()
    models = container.findall("model")
    bodies = tuple(body for model in models for body in _bodies(model, frames))
    report(root)
    return bodies


def _check_world(world: Element) -> None:
    check_children(world)
    for owner in (world, *world.findall("physics")):
        gravity = child(owner, "gravity")
        if gravity is not None:
            x, y, z = numbers(gravity, 3)
            if max(abs(x), abs(y), abs(z + 9.81)) > 0.05:
                raise fault(gravity, f"must be 0 0 -9.81, not {x:g} {y:g} {z:g}", "correct it")


def _apply_state(state: Element, scope: Path, frames: Frames) -> None:
    for part in state.iterchildren("model", "link"):
        check_children(part, f"state/{local_tag(part)}")
        path = (*scope, name_of(part))
        scale = child(part, "scale")
        if scale is not None and numbers(scale, 3) != (1.0, 1.0, 1.0):
            raise fault(scale, "must be 1 1 1", "change the sizes of the model's shapes")
        place = read_pose(part)
        if place.base not in ("", "world"):
            problem = f"must not be relative to {shown(place.base)}"
            raise fault(place.element, problem, "give its world pose")
        if place.element is not part and not frames.place(path, place.pose):
            warn(LOG, part, "is left out: the world has nothing of this name")
        elif part.tag == "model":
            _apply_state(part, path, frames)


def _bodies(model: Element, frames: Frames) -> list[Body]:
    """The bodies of a top-level model: links that fixed joints join move as one."""
    links: list[Link] = []
    owner: dict[Path, Path] = {}  # from a link towards the one that stands for its body; () fixed
    models = list(_nested(model, (), False))
    for path, part, fixed in models:
        for element in part.findall("link"):
            link = read_link(element, (*path, name_of(element)), frames, fixed)
            links.append(link)
            owner[link.path] = () if fixed else link.path
    for path, part, fixed in models:
        # Nothing static moves, whatever joins it.
        for joint in () if fixed else part.findall("joint"):
            _join(joint, path, frames, owner)
    groups: dict[Path, list[Link]] = {}
    for link in links:
        groups.setdefault(_root(owner, link.path), []).append(link)
    bodies = fixed_bodies(groups.pop((), []))
    for group in groups.values():
        bodies += movable_body(group, alone=len(groups) == 1 and not bodies)
    return bodies


def _nested(model: Element, scope: Path, fixed: bool) -> Iterator[tuple[Path, Element, bool]]:
    """A model and all models in it: path, element, and whether it is static."""
    # Gazebo writes <static> twice where a model was made static later: the last one counts.
    given = [flag(element) for element in model.findall("static")]
    fixed = fixed or (bool(given) and given[-1])
    path = (*scope, name_of(model))
    yield path, model, fixed
    for part in model.findall("model"):
        yield from _nested(part, path, fixed)


def _join(joint: Element, scope: Path, frames: Frames, owner: dict[Path, Path]) -> None:
    """Let the two links of a fixed joint belong to one body."""
    if joint.get("type") != "fixed":
        kind = shown(joint.get("type", ""))
        cure = 'make it type="fixed", or the model static'
        raise fault(joint, f"has type {kind}: parts that move are not supported", cure)
    ends = []
    for tag in ("parent", "child"):
        end = needed(joint, tag)
        # An end that is joined to the world is an end that is fixed to the ground.
        path = () if text_of(end) == "world" else frames.find(scope, text_of(end), end)
        if path and path not in owner:
            raise fault(end, f"must name a link, not {shown(text_of(end))}", "name a link")
        ends.append(_root(owner, path))
    # The ground, (), stays at the end of the chain.
    first, last = ends if ends[0] else ends[::-1]
    if first:
        owner[first] = last


def _root(owner: dict[Path, Path], path: Path) -> Path:
    while path and owner[path] != path:
        path = owner[path]
    return path

"""Reads the bodies of an SDF file (versions 1.4 to 1.11) with a ``<world>`` or with models alone.

The reader uses an element, ignores it because it cannot matter here, reports it as a warning of
the logger ``evoros.sdf``, or refuses it (see ``evoros.formats.sdf.elements``). It drops none
silently.

A ``<state>`` moves models and links to world poses, as in Gazebo. Links that are connected by fixed
joints become one body. A link without mass gets 1 kg, the default of SDF.
"""

import re
from collections.abc import Iterator

from lxml.etree import _Element as Element

from evoros.formats.sdf.bodies import build_fixed_bodies, build_movable_body
from evoros.formats.sdf.elements import LOG, check_children, report_ignored
from evoros.formats.sdf.frames import Frames, Path, read_pose
from evoros.formats.sdf.links import Link, read_link
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    local_tag,
    parse,
    quote,
    read_flag,
    read_name,
    read_numbers,
    read_text,
    require_child,
    warn,
)
from evoros.geometry.shapes import Body


def read_sdf(content: bytes, source: str) -> tuple[Body, ...]:
    """Read the bodies of a file's content, in its order; ``source`` is its name in errors.

    Raises:
        InputError: the content cannot be read or simulated; the message has file, line and element.
    """
    root = parse(content, source)
    worlds = _check_root(root)
    container = worlds[0] if worlds else root
    if worlds:
        check_children(container)
        _check_gravity(container)
    frames = Frames(container)
    for state in container.findall("state"):
        check_children(state)
        _apply_state(state, (), frames)
    frames.check()
    models = container.findall("model")
    bodies = tuple(body for model in models for body in _build_bodies(model, frames))
    report_ignored(root)
    return bodies


def _check_root(root: Element) -> list[Element]:
    """Check the root and its version; return its ``<world>``, if there is one."""
    if root.tag != "sdf":
        raise element_error(root, "must be <sdf>", "give a file in SDF, version 1.4 to 1.11")
    version = re.fullmatch(r"1\.([0-9]{1,2})", root.get("version", "").strip())
    if version is None or not 4 <= int(version[1]) <= 11:
        found = quote(root.get("version", ""))
        problem = f"must have a version from 1.4 to 1.11, not {found}"
        raise element_error(root, problem, "convert the file")
    check_children(root)
    worlds = root.findall("world")
    if len(worlds) > 1 or (worlds and root.find("model") is not None):
        fix = "keep one <world>, or models only"
        raise element_error(worlds[-1], "must be alone in its file", fix)
    return worlds


def _check_gravity(world: Element) -> None:
    for parent in (world, *world.findall("physics")):
        gravity = find_child(parent, "gravity")
        if gravity is not None:
            x, y, z = read_numbers(gravity, 3)
            if max(abs(x), abs(y), abs(z + 9.81)) > 0.05:
                problem = f"must be 0 0 -9.81, not {x:g} {y:g} {z:g}"
                raise element_error(gravity, problem, "correct or delete it")


def _apply_state(state: Element, scope: Path, frames: Frames) -> None:
    for element in state.iterchildren("model", "link"):
        check_children(element, f"state/{local_tag(element)}")
        path = (*scope, read_name(element))
        scale = find_child(element, "scale")
        if scale is not None and read_numbers(scale, 3) != (1.0, 1.0, 1.0):
            raise element_error(scale, "must be 1 1 1", "change the sizes of the model's shapes")
        relative = read_pose(element)
        if relative.base not in ("", "world"):
            problem = f"must not be relative to {quote(relative.base)}"
            raise element_error(relative.element, problem, "give its world pose")
        has_pose = relative.element is not element
        if has_pose and not frames.move(path, relative.pose):
            warn(LOG, element, "is ignored: the world has nothing of this name")
        elif element.tag == "model":
            _apply_state(element, path, frames)


def _build_bodies(model: Element, frames: Frames) -> list[Body]:
    """Build the bodies of a top-level model; links that fixed joints connect are one body."""
    links: list[Link] = []
    # From each link towards the one that represents its body; () represents the ground.
    parents: dict[Path, Path] = {}
    models = list(_walk_models(model, (), False))
    for path, element, static in models:
        for child in element.findall("link"):
            link = read_link(child, (*path, read_name(child)), frames, static)
            links.append(link)
            parents[link.path] = () if static else link.path
    for path, element, static in models:
        # Joints do not move the links of a static model.
        for joint in () if static else element.findall("joint"):
            _join(joint, path, frames, parents)
    groups: dict[Path, list[Link]] = {}
    for link in links:
        groups.setdefault(_find_root(parents, link.path), []).append(link)
    bodies = build_fixed_bodies(groups.pop((), []))
    for group in groups.values():
        bodies += build_movable_body(group, alone=len(groups) == 1 and not bodies)
    return bodies


def _walk_models(model: Element, scope: Path, static: bool) -> Iterator[tuple[Path, Element, bool]]:
    """Yield path, element and whether it is static, of a model and of all models in it."""
    # Gazebo adds a second <static> if a model was made static later: the last one counts.
    flags = [read_flag(element) for element in model.findall("static")]
    static = static or (bool(flags) and flags[-1])
    path = (*scope, read_name(model))
    yield path, model, static
    for child in model.findall("model"):
        yield from _walk_models(child, path, static)


def _join(joint: Element, scope: Path, frames: Frames, parents: dict[Path, Path]) -> None:
    """Make the two links of a fixed joint belong to one body."""
    if joint.get("type") != "fixed":
        kind = quote(joint.get("type", ""))
        problem = f"has type {kind}, but parts that move against each other are not supported"
        raise element_error(joint, problem, 'make it type="fixed", or the model static')
    roots = []
    for tag in ("parent", "child"):
        end = require_child(joint, tag)
        name = read_text(end)
        # A link that is joined to the world is fixed to the ground.
        path = () if name == "world" else frames.find(scope, name, end)
        if path and path not in parents:
            raise element_error(end, f"must name a link, not {quote(name)}", "name a link")
        roots.append(_find_root(parents, path))
    # The ground, (), stays at the end of the chain.
    first, last = roots if roots[0] else roots[::-1]
    if first:
        parents[first] = last


def _find_root(parents: dict[Path, Path], path: Path) -> Path:
    while path and parents[path] != path:
        path = parents[path]
    return path

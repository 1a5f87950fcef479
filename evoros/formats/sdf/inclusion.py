"""Replaces each ``<include>`` in an SDF document with the model that it names."""

import itertools
import re
from pathlib import Path

from lxml import etree
from lxml.etree import _Element as Element

from evoros.formats import strict_xml as xml
from evoros.formats.missing import Absence, MissingFileError
from evoros.formats.sdf.reading import Reading

CHOICES = (
    "type world.NAME.missing=leave_out, or world.NAME.missing=box to replace missing meshes of "
    "known size with boxes"
)


def require_files(container: Element, reading: Reading) -> None:
    """Check that all named models, meshes and images exist, unless ``missing`` allows gaps."""
    if reading.options.missing != "error":
        return
    for collision in container.iter("collision"):
        for shape in collision.iterfind("geometry/*"):
            uri = find_uri(shape) if shape.tag in ("mesh", "heightmap") else None
            if uri is not None and _find(uri, reading) is None:
                add_absence(uri, xml.read_text(uri), reading)
    reading.absences.require_none(CHOICES)


def drop_loose_joints(reading: Reading) -> None:
    """Remove joints to parts of missing included models."""
    for model in reading.incomplete:
        names = {part.get("name") for part in model.iter("model", "link", "frame", "joint")}
        for joint in [*model.iter("joint")]:
            ends = [(joint.findtext(tag) or "").strip() for tag in ("parent", "child")]
            if {end.split("::")[-1] for end in ends} <= {*names, "world", "__model__"}:
                continue
            problem = f"is left out: it connects {' and '.join(ends)}, one of which is missing"
            reading.notes.add(joint, problem, "joint of a missing model")
            parent = joint.getparent()
            assert parent is not None
            parent.remove(joint)


def find_uri(shape: Element) -> Element | None:
    """Return the element that holds the file name of a mesh or height map."""
    uri = xml.find_child(shape, "uri")
    return xml.find_child(shape, "filename") if uri is None else uri


def add_absence(element: Element, uri: str, reading: Reading) -> None:
    """Record that no file was found at the address in an element."""
    problem, remedy = reading.addresses.explain(uri, reading.folder_of(element))
    kind = "model" if element.tag == "include" else "mesh"
    sentence = f"{xml.locate(element)} {problem}"
    reading.absences.add(Absence(kind, uri, xml.place_of(element), sentence, remedy))


def require_file(uri: Element, reading: Reading) -> Path:
    """Return the file named in the element ``uri``; raise MissingFileError if not found."""
    place = _find(uri, reading)
    if place is None:
        problem, remedy = reading.addresses.explain(xml.read_text(uri), reading.folder_of(uri))
        raise MissingFileError(str(xml.element_error(uri, problem, f"{remedy}; or {CHOICES}")))
    return place


def _find(uri: Element, reading: Reading) -> Path | None:
    return reading.addresses.find(xml.read_text(uri), reading.folder_of(uri), Path.is_file)


_BASICS = {
    "ground_plane": "<model name='ground_plane'><static>true</static><link name='link'>"
    "<collision name='collision'><geometry><plane/></geometry></collision></link></model>",
    "sun": "<light name='sun'/>",
}
"""Gazebo's basic models, for machines without Gazebo."""
_NEWEST = 12


def expand_includes(container: Element, reading: Reading, chain: tuple[Path, ...] = ()) -> None:
    """Replace the includes of a world or model, and of the models inside."""
    for model in container.findall("model"):
        expand_includes(model, reading, chain)
    for include in container.findall("include"):
        model_element = _load(include, reading, chain)
        if model_element is None:
            container.remove(include)
            continue
        _adapt(include, model_element)
        if xml.is_set(include, "merge") and container.tag == "model":
            _merge(include, model_element, container)
        else:
            container.replace(include, model_element)
    _rename_duplicates(container, reading)


def _load(include: Element, reading: Reading, chain: tuple[Path, ...]) -> Element | None:
    element = xml.require_child(include, "uri")
    uri = xml.read_text(element)
    beside = reading.folder_of(include)
    if (uri, beside) not in reading.models:
        reading.models[uri, beside] = _find_model(uri, beside, reading)
    file = reading.models[uri, beside]
    if file is None:
        return _stand_in(include, uri, reading)
    if file in chain:
        circle = " -> ".join(str(f) for f in (*chain[chain.index(file) :], file))
        problem = f"includes itself: {circle}"
        raise xml.element_error(include, problem, "delete one of these includes")
    root = reading.parse(file)
    if root.tag == "robot":
        problem = f"is left out: {file} describes a robot (URDF), not a part of a world"
        reading.notes.add(include, problem)
        return None
    model = _choose_model(root, include, reading, file)
    if model is not None:
        expand_includes(model, reading, (*chain, file))
        model.set(xml.SOURCE, str(file))
    return model


def _find_model(uri: str, beside: Path, reading: Reading) -> Path | None:
    """Return the SDF file at an address; ``x.model`` of SDF 1.0 may now be ``x``."""
    old = re.fullmatch(r"([^/]+)\.(model|light)", uri)
    for address in (uri, f"model://{old[1]}") if old else (uri,):
        place = reading.addresses.find(address, beside, lambda p: _find_sdf(p, reading) is not None)
        if place is not None:
            return _find_sdf(place, reading)
    return None


def _stand_in(include: Element, uri: str, reading: Reading) -> Element | None:
    name = uri.rstrip("/").split("/")[-1].lower().replace("%20", "_").replace(" ", "_")
    name = re.sub(r"\.(model|light)$", "", name)
    if name in _BASICS:
        return etree.fromstring(f"<sdf>{_BASICS[name]}</sdf>").find("model")
    if reading.options.missing == "error":
        add_absence(include, uri, reading)
        return None
    problem, _ = reading.addresses.explain(uri, reading.folder_of(include))
    reading.notes.add(include, f"is left out: it {problem}", "missing model", uri)
    parent = include.getparent()
    if parent is not None and parent.tag == "model":
        reading.incomplete.append(parent)
    return None


def _choose_model(root: Element, include: Element, reading: Reading, file: Path) -> Element | None:
    if root.tag not in ("sdf", "gazebo"):
        raise xml.element_error(root, "must be <sdf>", "name a model in SDF")
    models = root.findall("model")
    if not models:
        if root.find("light") is None and root.find("actor") is None:
            fix = "add one, or include another file"
            raise xml.element_error(root, "must contain a <model>", fix)
        actor, world = root.find("actor"), include.getparent()
        if actor is not None and world is not None:
            actor.set("name", (include.findtext("name") or actor.get("name") or "").strip())
            actor.set(xml.SOURCE, str(root.get(xml.SOURCE, "")))
            world.append(actor)
        return None
    if len(models) > 1:
        names = ", ".join(xml.quote(model.get("name", "")) for model in models[1:])
        problem = f"includes only the first model of {file}, as in Gazebo; {names} are left out"
        reading.notes.add(include, problem)
    return models[0]


def _find_sdf(place: Path, reading: Reading) -> Path | None:
    if place.is_file():
        return place.resolve()
    config = place / "model.config"
    if config.is_file():
        root = reading.parse(config)
        listed = []
        for element in root.findall("sdf"):
            match = re.fullmatch(r"1\.([0-9]{1,2})", element.get("version", "").strip())
            listed.append((int(match[1]) if match else 0, (element.text or "").strip()))
        for version, name in sorted(listed, reverse=True):
            if version <= _NEWEST and name and (place / name).is_file():
                return (place / name).resolve()
    candidates = [place / "model.sdf", *sorted(place.glob("*.sdf"))]
    return next((file.resolve() for file in candidates if file.is_file()), None)


def _adapt(include: Element, model: Element) -> None:
    source = xml.source_of(include)
    for tag in ("name", "placement_frame"):
        element = xml.find_child(include, tag)
        if element is not None:
            model.set(tag, xml.read_text(element))
    pose = xml.find_child(include, "pose")
    if pose is not None:
        for old in model.findall("pose"):
            model.remove(old)
        pose.set(xml.SOURCE, source)
        model.insert(0, pose)
    static = xml.find_child(include, "static")
    if static is not None:
        xml.read_flag(static)
    for part in [*include.findall("static"), *include.findall("plugin")]:
        part.set(xml.SOURCE, source)
        model.append(part)  # Gazebo uses the last <static>


def _merge(include: Element, model: Element, container: Element) -> None:
    """Move the parts of a model to the model that includes it, with the same poses."""
    source = str(model.get(xml.SOURCE))
    name = f"_merged_{xml.read_name(model)}"
    frame = etree.Element("frame", {"name": name, xml.SOURCE: source})
    pose = model.find("pose")
    if pose is not None:
        frame.append(pose)
    placement = model.get("placement_frame")
    if placement:
        frame.set("placement_frame", placement)
    position = container.index(include)
    container.remove(include)
    for child in [*model]:
        if child.tag in ("pose", "static"):
            continue
        _anchor(child, name)
        child.set(xml.SOURCE, source)
        container.insert(position, child)
        position += 1
    container.insert(0, frame)


def _anchor(child: Element, frame: str) -> None:
    """Make the pose of a merged part relative to the frame that replaces the model."""
    for element in child.iter("pose", "parent", "child"):
        for attribute in ("relative_to", "frame"):
            if element.get(attribute) == "__model__":
                element.set(attribute, frame)
        if (element.text or "").strip() == "__model__":
            element.text = frame
    if child.get("attached_to") == "__model__":
        child.set("attached_to", frame)
    if child.tag not in ("link", "frame", "model"):
        return
    if child.tag == "frame" and child.get("attached_to"):
        return
    pose = child.find("pose")
    if pose is None:
        pose = etree.SubElement(child, "pose")
    if not (pose.get("relative_to") or pose.get("frame")):
        pose.set("relative_to", frame)


def _rename_duplicates(container: Element, reading: Reading) -> None:
    """Rename elements with equal names: append a number, as Gazebo does, or ``_joint``."""
    taken: dict[str, str] = {}
    parts = container.iterchildren("model", "link", "frame", "joint", "collision")
    for element in sorted(parts, key=lambda part: part.tag == "joint"):
        name = element.get("name", "").strip()
        tag, other = str(element.tag), taken.get(name)
        is_named_twice = other == tag and tag in ("model", "link", "collision")
        if name and (is_named_twice or (tag == "joint" and other not in (None, tag))):
            stem = name if is_named_twice else f"{name}_joint"
            numbered = (f"{stem}_{index}" for index in itertools.count())
            names = numbered if is_named_twice else itertools.chain([stem], numbered)
            new = next(text for text in names if text not in taken)
            problem = f"has a name that is already in use, and is renamed to {xml.quote(new)}"
            reading.notes.add(element, problem, "renamed")
            element.set("name", new)
            name = new
        taken[name] = tag
    for link in container.findall("link"):
        _rename_duplicates(link, reading)

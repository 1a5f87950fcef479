"""The meshes and images that an SDF file names, which are sought before any mesh is read."""

from pathlib import Path

from lxml.etree import _Element as Element

from evoros.formats.missing import Absence, MissingFileError
from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import element_error, find_child, locate, place_of, read_text

CHOICES = "set missing=leave_out, or missing=box for boxes in place of meshes of known size"


def require_files(container: Element, reading: Reading) -> None:
    """Require all models, meshes and images that a world names, unless ``missing`` says otherwise.

    Raises:
        InputError: some are absent; the message has all of them.
    """
    if reading.options.missing != "error":
        return
    for collision in container.iter("collision"):
        for shape in collision.iterfind("geometry/*"):
            uri = find_uri(shape) if shape.tag in ("mesh", "heightmap") else None
            if uri is not None and _find(uri, reading) is None:
                add_absence(uri, read_text(uri), reading)
    reading.absences.require_none(CHOICES)


def drop_loose_joints(reading: Reading) -> None:
    """Leave out the joints of models that lack an included model, if they connect what is in it."""
    for model in reading.incomplete:
        names = {part.get("name") for part in model.iter("model", "link", "frame", "joint")}
        for joint in [*model.iter("joint")]:
            ends = [(joint.findtext(tag) or "").strip() for tag in ("parent", "child")]
            if {end.split("::")[-1] for end in ends} <= {*names, "world", "__model__"}:
                continue
            problem = f"is left out: it connects {' and '.join(ends)}, of which one is absent"
            reading.notes.add(joint, problem, "joint of an absent model")
            parent = joint.getparent()
            assert parent is not None
            parent.remove(joint)


def find_uri(shape: Element) -> Element | None:
    """Return the element of a mesh or height map that names its file."""
    uri = find_child(shape, "uri")
    return find_child(shape, "filename") if uri is None else uri


def add_absence(element: Element, uri: str, reading: Reading) -> None:
    """Collect that nothing is at an address that an element names."""
    problem, remedy = reading.addresses.explain(uri, reading.folder_of(element))
    kind = "model" if element.tag == "include" else "mesh"
    sentence = f"{locate(element)} {problem}"
    reading.absences.add(Absence(kind, uri, place_of(element), sentence, remedy))


def require_file(uri: Element, reading: Reading) -> Path:
    """Return the file that the element ``uri`` names.

    Raises:
        MissingFileError: it is absent.
    """
    place = _find(uri, reading)
    if place is None:
        problem, remedy = reading.addresses.explain(read_text(uri), reading.folder_of(uri))
        raise MissingFileError(str(element_error(uri, problem, f"{remedy}; or {CHOICES}")))
    return place


def _find(uri: Element, reading: Reading) -> Path | None:
    return reading.addresses.find(read_text(uri), reading.folder_of(uri), Path.is_file)

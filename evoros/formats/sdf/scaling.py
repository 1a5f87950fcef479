"""The ``<scale>`` that the ``<state>`` of a world gives to a model, as Gazebo applies it."""

from lxml import etree
from lxml.etree import _Element as Element

from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import element_error, read_numbers


def scale_model(model: Element, scale: Element, reading: Reading) -> None:
    """Multiply the sizes of a model's collisions; a mesh gets the scale in place of its own.

    As in Gazebo, the poses of links and collisions stay.
    """
    values = read_numbers(scale, 1, 3)
    x, y, z = values * 3 if len(values) == 1 else values
    if (x, y, z) == (1.0, 1.0, 1.0):
        return
    if min(x, y, z) <= 0:
        raise element_error(scale, "must be greater than 0", "write three positive numbers")
    reading.notes.add(scale, f"scales the sizes of its shapes by {x:g} {y:g} {z:g}, as in Gazebo")
    factors: dict[str, dict[str, tuple[float, ...]]] = {
        "box": {"size": (x, y, z)},
        "sphere": {"radius": (max(x, y, z),)},
        "cylinder": {"radius": (max(x, y),), "length": (z,)},
        "capsule": {"radius": (max(x, y),), "length": (z,)},
        "cone": {"radius": (max(x, y),), "length": (z,)},
        "ellipsoid": {"radii": (x, y, z)},
    }
    for solid in model.iterfind(".//collision/geometry/*"):
        for tag, by in factors.get(str(solid.tag), {}).items():
            for element in solid.findall(tag):
                sizes = read_numbers(element, len(by))
                element.text = " ".join(repr(a * b) for a, b in zip(sizes, by, strict=True))
        if solid.tag == "mesh":
            own = solid.find("scale")
            element = etree.SubElement(solid, "scale") if own is None else own
            element.text = f"{x!r} {y!r} {z!r}"

"""Reads a world from an SDF file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.resources import find_file
from evoros.formats.lenient_xml import is_xacro
from evoros.formats.sdf.reader import SdfWorld, read_sdf
from evoros.formats.sdf.reading import SdfOptions
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions, choose_instead, expand
from evoros.world.course import Course
from evoros.world.embedded import free_bodies
from evoros.world.floors import settle
from evoros.world.model import World


def load_world(
    sdf: str,
    course: Course,
    model_paths: Sequence[str] = (),
    world_name: str = "",
    arguments: Mapping[str, object] | None = None,
    missing: str = "error",
    vehicles: str = "leave_out",
    mesh_up_axis: str = "ignore",
    actors: str = "walk",
) -> World:
    """Load the world of an SDF file, with ground below the course and no body in another one.

    ``sdf`` is a path, which may be relative to the bundled folder ``worlds``. ``model_paths`` are
    folders that hold the models and meshes that it names, ``world_name`` selects one of several
    worlds in the file, and ``arguments`` are for a file with xacro. ``missing`` (``error``,
    ``leave_out`` or ``box``) states what to do with absent models and meshes, ``vehicles``
    (``leave_out`` or ``hold_still``) what with vehicles, and ``mesh_up_axis`` (``ignore`` or
    ``apply``) whether DAE files are turned as their ``<up_axis>`` says. ``actors`` (``walk`` or
    ``leave_out``) states what to do with actors. In messages the world has the name of its file;
    tables name it by its key in the configuration.

    Raises:
        InputError: a file is missing or cannot be used, or a waypoint lies in an obstacle.
    """
    options = SdfOptions(tuple(model_paths), world_name, missing, vehicles, mesh_up_axis, actors)
    world = read_world(sdf, options, arguments or {})
    name = Path(sdf).name.partition(".")[0]
    bodies = free_bodies(settle(world.bodies, course, sdf), sdf)
    gravity, walking = world.gravity_mps2, world.actors
    return World(name, bodies, course, sdf, world.sha256, gravity_mps2=gravity, actors=walking)


def read_world(sdf: str, options: SdfOptions, arguments: Mapping[str, object]) -> SdfWorld:
    """Read the bodies of an SDF file where the file puts them; see ``load_world``.

    Raises:
        InputError: a file is missing or cannot be used.
    """
    path = find_file(sdf, "worlds")
    content, source = path.read_bytes(), sdf
    if is_xacro(path, content):
        folders = options.model_paths
        xacro = ReadOptions(arguments=arguments, packages=folders, packages_key="model_paths")
        text, absences = expand(path, xacro, index_packages(path, folders))
        absences.require_none(choose_instead(absences, xacro))
        content, source = text.encode(), f"{sdf} (expanded)"
    elif arguments:
        raise InputError(
            f"{sdf}: a world without xacro takes no arguments, not {sorted(arguments)}; "
            f"remove them or name a .xacro file"
        )
    return read_sdf(content, source, options, path)

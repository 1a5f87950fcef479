"""docs/architecture.md names every room, its floor and the libraries that it may import."""

import ast
import re
import sys
from configparser import ConfigParser
from functools import cache
from pathlib import Path
from runpy import run_path

from documents import DOCS, table, text
from helpers import ROOT

from evoros.files.plugins import find_plugins

FOLDERS = ("evoros", "analysis")
ROS_SCRIPTS = "evoros/plugins/ros/bridge/"
ROS = {
    "builtin_interfaces",
    "genpy",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph",
    "rosgraph_msgs",
    "roslib",
    "rospy",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
}


@cache
def modules() -> dict[str, Path]:
    """Every Python file of the package, by its path from the root; analysis/ lies at the top."""
    paths = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    names = {str(path.relative_to(ROOT)): path for path in paths}
    return {name: path for name, path in names.items() if "/tests/" not in name}


@cache
def imported(path: Path) -> set[str]:
    """The dotted names of the modules that a file imports when it runs."""
    nodes = [*ast.walk(ast.parse(path.read_text()))]
    type_checking = {
        id(inner)
        for node in nodes
        if isinstance(node, ast.If)
        and any(getattr(part, "id", "") == "TYPE_CHECKING" for part in ast.walk(node.test))
        for inner in ast.walk(node)
    }
    names: set[str] = set()
    for node in nodes:
        if id(node) in type_checking:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def libraries(files: dict[str, Path]) -> set[str]:
    names = {name.partition(".")[0] for path in files.values() for name in imported(path)}
    return names - sys.stdlib_module_names - {"evoros"}


def core() -> dict[str, Path]:
    """The modules that are no plug-in's; a plug-in may import the libraries of its option."""
    return {name: path for name, path in modules().items() if "/plugins/" not in name}


def importers(library: str) -> set[str]:
    return {
        name
        for name, path in core().items()
        if library in {module.partition(".")[0] for module in imported(path)}
    }


def rooms() -> dict[str, str]:
    """The floor of each room, as the document's table says."""
    rows = table(text("architecture"), "room")
    return {row[0].removesuffix("/").removesuffix(".py"): row[1] for row in rows}


def test_every_room_is_in_the_table_and_every_row_is_a_room() -> None:
    folders = {"/".join(Path(name).parent.parts[:2]) for name in modules()}
    assert set(rooms()) == {*folders, "evoros/api", "evoros/parts"}


def test_every_plugin_is_in_the_table_with_its_extras() -> None:
    rows = {re.findall(r"\w+", row[0])[0]: row[2] for row in table(text("architecture"), "plug-in")}
    assert rows == {name: ", ".join(plugin.extras) for name, plugin in find_plugins().items()}


def contract(name: str, key: str) -> list[str]:
    """The lines of a key of the import contract."""
    parser = ConfigParser()
    parser.read(ROOT / ".importlinter")
    return parser[f"importlinter:contract:{name}"][key].split("\n")[1:]


def test_the_floors_are_those_of_the_import_contract() -> None:
    layers = contract("layers", "layers")
    floors = {
        module.strip().replace(".", "/").replace("evoros/analysis", "analysis"): str(
            len(layers) - index
        )
        for index, layer in enumerate(layers)
        for module in layer.split("|")
    }
    documented = {room: floor for room, floor in rooms().items() if floor}
    outermost = {room: floor for room, floor in documented.items() if room in floors}
    assert outermost == floors
    within = set(documented) - set(
        floors
    )  # these are rooms of analysis/, one floor to the contract
    assert {documented[room] for room in within} == {floors["analysis"]}
    assert all(room.startswith("analysis/") for room in within)


def test_the_picture_shows_the_table() -> None:
    drawing = run_path(str(DOCS / "img" / "rooms.py"))["drawing"]
    assert (DOCS / "img" / "rooms.svg").read_text() == drawing(text("architecture"))


def test_libraries_are_imported_only_where_the_document_says() -> None:
    for library, places in table(text("architecture"), "library"):
        allowed = re.findall(r"[\w./]+", places)
        names = importers(library)
        for name in names:
            assert any(name.startswith(place) for place in allowed), name
        for place in allowed:
            assert any(name.startswith(place) for name in names), (library, place)


def test_every_library_is_in_the_table_or_in_the_import_contract() -> None:
    files = {name: path for name, path in core().items() if not name.startswith(ROS_SCRIPTS)}
    rows = [row[0] for row in table(text("architecture"), "library")]
    limited = {*contract("engines", "forbidden_modules"), *contract("hydra", "forbidden_modules")}
    assert limited.isdisjoint(rows)
    assert set(rows) <= libraries(files) <= {"numpy", *rows, *limited}


def test_the_scripts_that_run_in_the_python_of_ros_import_only_ros() -> None:
    files = {name: path for name, path in modules().items() if name.startswith(ROS_SCRIPTS)}
    assert libraries(files) == ROS

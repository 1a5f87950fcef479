"""The subcommand ``inspect``: shows a robot or a world, and writes the YAML to start from."""

import shlex
from argparse import SUPPRESS, RawDescriptionHelpFormatter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evoros.base.errors import InputError
from evoros.files.resources import expand_home
from evoros.terminal.arguments import CommandParser
from evoros.terminal.console import DONE, print_result, reports_errors

if TYPE_CHECKING:
    from evoros.config.own_files import OwnFile
    from evoros.session.inspection import Inspection

NAME = "evoros inspect"
DEFAULT_FOLDER = "mine"
SIMULATOR = "simulator="
USAGE = f"""{NAME} robot FILE world FILE [key=value ...] [options]

It shows how evoros reads a robot or a world that somebody else wrote, and writes the YAML files
with which evoros uses them.

{NAME} robot FILE [key=value ...]          a URDF or xacro file
{NAME} world FILE [key=value ...]          an SDF, .world or xacro file
{NAME} robot FILE world FILE [robot.key=value ...] [world.key=value ...]

The keys are those of the group's YAML files, as docs/your_robot.md explains them:
  {NAME} robot scout.urdf.xacro arguments.laser=true packages=[../sensors]
  {NAME} world depot.world model_paths=[models] vehicles=hold_still
  {NAME} world depot.world course.home_x_m=2 course.home_y_m=-1
simulator=NAME is the simulator to build them for; default: planar, or physics on uneven ground."""
EPILOG = "Existing files are kept: delete them, or choose another folder or name."
ROBOT_KEYS: Mapping[str, Any] = {
    "drive": {"max_speed_mps": None},
    "mount": {"link": None, "z_m": None, "pitch_deg": None},
}
"""Keys to start from, which most robots need."""


@dataclass(frozen=True)
class Request:
    """A part to inspect: its group, its file and the values of further keys."""

    group: str
    file: Path
    values: Mapping[str, Any]


@reports_errors(NAME)
def inspect(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status: 0, or 2 for input that cannot be used."""
    from evoros.session.inspection import LEVEL, require_design

    options = _parser().parse_intermixed_args(list(arguments))
    simulators = [word for word in options.words if word.startswith(SIMULATOR)]
    requests = _parse([word for word in options.words if word not in simulators])
    folder = expand_home(options.config_dir)
    if options.name and len(requests) > 1:
        raise InputError("--name: names one part, and there are two; inspect them one by one")
    chosen: list[str] = []  # the parts
    further: list[str] = []  # other overrides of a run with them
    shown: list[str] = []
    for request in requests:
        part, simulator = _describe(request, options.name, chosen, folder)
        simulator = simulators[-1] if simulators else simulator
        inspection = _write_yaml(part, folder, chosen, simulator)
        picture = (folder / part.path).with_suffix(".png")
        _write(picture, inspection.picture, replace=True)
        print_result(_format(inspection, shown))
        files = [folder / part.path, picture]
        chosen.append(f"{part.group}={part.name}")
        if inspection.design is not None:
            files.append(folder / inspection.design.path)
            with _kept_if_usable(folder, inspection.design):
                require_design(inspection.design.name, folder, chosen)
        print_result("written " + "\n        ".join(map(str, files)))
        shown += inspection.messages
        further = [word for word in further if not word.startswith(SIMULATOR)]
        further += inspection.choices
    words = [word for word in (*chosen, *further) if word != LEVEL]  # the default
    print_result(f"to use  {shlex.join(['evoros', '--config-dir', str(folder), *words])}")
    return DONE


def _parser() -> CommandParser:
    parser = CommandParser(
        NAME, usage=USAGE, epilog=EPILOG, formatter_class=RawDescriptionHelpFormatter
    )
    parser.add_argument("words", nargs="*", help=SUPPRESS)
    parser.add_argument(
        "--config-dir",
        metavar="FOLDER",
        default=DEFAULT_FOLDER,
        help="folder for robot/NAME.yaml, world/NAME.yaml and pictures; default: mine",
    )
    parser.add_argument(
        "--name", metavar="NAME", help="name of the part, if it is one; default: as its file"
    )
    return parser


def _parse(words: Sequence[str]) -> list[Request]:
    """Parse ``robot FILE world FILE key=value ...``; the robot comes first in the result."""
    from evoros.config.own_files import ROBOT, WORLD, parse_keys

    files: dict[str, Path] = {}
    keys = [word for word in words if "=" in word and not Path(word).is_file()]
    names = iter([word for word in words if word not in keys])
    for group in names:
        if group not in (ROBOT, WORLD) or group in files:
            raise InputError(f"{group}: must be robot FILE or world FILE, once each; correct it")
        file = expand_home(next(names, ""))
        if not file.is_file():
            raise InputError(f"{group} {file}: must be an existing file; correct the path")
        files[group] = file  # relative if typed so: the files may be moved together
    if not files:
        raise InputError("must be told robot FILE, world FILE or both; add one")
    if len(files) == 1:
        (group,) = files
        keys = [key.removeprefix(f"{group}.") for key in keys]
        return [Request(group, files[group], parse_keys(keys))]
    values = parse_keys(keys)
    unknown = sorted(set(values) - set(files))
    if unknown:
        raise InputError(f"{unknown[0]}: must start with robot. or world.; add which part it is of")
    return [Request(group, files[group], values.get(group, {})) for group in (ROBOT, WORLD)]


def _describe(
    request: Request, name: str | None, chosen: Sequence[str], folder: Path
) -> "tuple[OwnFile, str]":
    """Describe the YAML file of a part, and choose the simulator that it needs.

    A world without a course gets one that fits the robot.
    """
    from evoros.config.own_files import ROBOT, OwnFile, choose_name, is_bundled
    from evoros.session.course_planning import plan_course
    from evoros.session.inspection import LEVEL, UNEVEN, find_robot

    own_name = name or choose_name(request.file, request.group)
    if is_bundled(request.group, own_name):  # it would win over the user's
        raise InputError(
            f"--name {own_name}: must be no bundled {request.group}; choose another name"
        )
    title = f"{own_name}, read from {request.file.name} by evoros inspect."
    if request.group == ROBOT:
        values = {"description": str(request.file), **ROBOT_KEYS, **request.values}
        return OwnFile(request.group, own_name, title, values), LEVEL
    values = {"sdf": str(request.file), **request.values}
    planned = plan_course(values, find_robot(chosen, folder))
    values["course"] = planned.course
    if not planned.is_level:
        title += f" Its ground is not level, so that it needs {UNEVEN}."
    simulator = LEVEL if planned.is_level else UNEVEN
    return OwnFile(request.group, own_name, title, values), simulator


def _write_yaml(
    part: "OwnFile", folder: Path, chosen: Sequence[str], simulator: str
) -> "Inspection":
    """Write the YAML file and build the part from it."""
    from evoros.analysis.drawing.inspection import draw_robot_picture
    from evoros.analysis.drawing.worlds import draw_world_picture
    from evoros.config.own_files import ROBOT
    from evoros.session.inspection import inspect_robot, inspect_world

    with _kept_if_usable(folder, part):
        if part.group == ROBOT:
            return inspect_robot(part.name, folder, simulator, draw_robot_picture)
        return inspect_world(part.name, folder, chosen, simulator, draw_world_picture)


@contextmanager
def _kept_if_usable(folder: Path, part: "OwnFile") -> Iterator[None]:
    """Write a YAML file, which is deleted again if the part cannot be built from it."""
    path = folder / part.path
    _write(path, part.text.encode())
    try:
        yield
    except BaseException:
        path.unlink()
        raise


def _write(path: Path, content: bytes, replace: bool = False) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb" if replace else "xb") as file:
            file.write(content)
    except FileExistsError as error:
        raise InputError(
            f"{path}: must be a new file, and it exists; delete it, or give --name or --config-dir"
        ) from error
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another") from error


def _format(inspection: "Inspection", shown: Sequence[str]) -> str:
    """Return the table, with the messages that have not been ``shown`` with another part."""
    here = f"{Path.cwd()}/"  # paths below the current folder are shorter without it
    messages = [text.replace(here, "") for text in inspection.messages if text not in shown]
    rows = [*inspection.rows, *(("told", message) for message in messages)]
    width = max(len(name) for name, _ in rows)
    return "\n".join([inspection.title, *(f"  {name:<{width}}  {text}" for name, text in rows)])

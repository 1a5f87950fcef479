"""The subcommand ``inspect``: shows how evoros reads a robot or world, and writes its YAML file."""

from argparse import SUPPRESS
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evoros.base.errors import InputError, shell_line
from evoros.files.resources import expand_home
from evoros.terminal.activity import tell_slow
from evoros.terminal.console import DONE, CommandParser, print_result, reports_errors

if TYPE_CHECKING:
    from evoros.config.own_files import OwnFile
    from evoros.session.inspection import Inspection

NAME = "evoros inspect"
DEFAULT_FOLDER = "mine"
SIMULATOR = "simulator="
_PLACEHOLDER = "world.NAME."  # prefix of world keys in messages from readers that know no name
DRIVE = "drive@robot.drive="
USAGE = f"""{NAME} robot FILE world FILE [key=value ...] [options]

Show how evoros reads a robot or world, and write the YAML files with which evoros can use it.

{NAME} robot FILE [key=value ...]          a URDF or xacro file
{NAME} world FILE [key=value ...]          an SDF, .world or xacro file
{NAME} robot FILE world FILE [robot.key=value ...] [world.NAME.key=value ...]

Keys are as in the YAML files of robots and worlds; docs/your_robot.md explains them:
  {NAME} robot scout.urdf.xacro arguments.laser=true packages=[../sensors]
  {NAME} world depot.world model_paths=[models] vehicles=hold_still
  {NAME} world depot.world world.depot.course.home_x_m=2 world.depot.course.home_y_m=-1
simulator=NAME chooses the simulator; default: planar, or physics on uneven ground.
drive@robot.drive=NAME chooses the kind of drive, with keys robot.drive.KEY; default: automatic."""
EPILOG = "Existing YAML files are never overwritten: delete them, or choose another folder or name."
ROBOT_KEYS: Mapping[str, Any] = {
    "drive": {"max_speed_mps": None},
    "mount": {"link": None, "z_m": None, "pitch_deg": None},
}
"""Keys that most robots need, written to the YAML file as a template."""


@dataclass(frozen=True)
class Request:
    """A robot or world to inspect."""

    group: str
    file: Path
    name: str
    values: Mapping[str, Any]  # values of other keys
    drive: str = ""  # option of the group drive; empty for the default


@reports_errors(NAME)
def inspect(arguments: Sequence[str]) -> int:
    """Run the command and return the exit status: 0, or 2 for invalid input."""
    from evoros.session.inspection import LEVEL, require_design

    options = _parser().parse_intermixed_args(list(arguments))
    simulators = [word for word in options.words if word.startswith(SIMULATOR)]
    words = [word for word in options.words if word not in simulators]
    requests = _parse(words, options.name)
    folder = expand_home(options.config_dir)
    if options.name and len(requests) > 1:
        raise InputError(
            "--name: applies to a single part; inspect the robot and the world one at a time"
        )
    chosen: list[str] = []  # overrides that select the parts
    further: list[str] = []  # further overrides needed to run the parts
    shown: list[str] = []
    for request in requests:
        with tell_slow(f"reading {request.file}"):
            part, simulator, reason = _describe(request, chosen, folder)
            simulator = simulators[-1] if simulators else simulator
            inspection = _write_yaml(part, folder, chosen, simulator, reason)
        picture = (folder / part.path).with_suffix(".png")
        _write(picture, inspection.picture, replace=True)
        print_result(_format(inspection, shown).replace(_PLACEHOLDER, f"world.{part.name}."))
        files = [folder / part.path, picture]
        chosen.append(f"{part.group}={part.name}")
        if inspection.design is not None:
            files.append(folder / inspection.design.path)
            with _kept_if_usable(folder, inspection.design):
                require_design(inspection.design.name, folder, chosen)
        print_result(_list_written(part, files))
        shown += inspection.messages
        further = [word for word in further if not word.startswith(SIMULATOR)]
        further += inspection.choices
    words = [word for word in (*chosen, *further) if word != LEVEL]  # LEVEL is the default
    print_result(f"to use  {shell_line('evoros', '--config-dir', str(folder), *words)}")
    return DONE


def _parser() -> CommandParser:
    parser = CommandParser(NAME, usage=USAGE, epilog=EPILOG)
    parser.add_argument("words", nargs="*", help=SUPPRESS)
    parser.add_argument(
        "--config-dir",
        metavar="FOLDER",
        default=DEFAULT_FOLDER,
        help="folder for robot/NAME.yaml, world/NAME.yaml and pictures; default: mine",
    )
    parser.add_argument(
        "--name", metavar="NAME", help="name of a single part; default: the name of its file"
    )
    return parser


def _parse(words: Sequence[str], name: str | None) -> list[Request]:
    """Parse ``robot FILE world FILE key=value ...``; return the robot first."""
    from evoros.config.own_files import ROBOT, WORLD, choose_name, parse_keys

    files: dict[str, Path] = {}
    settings = [word for word in words if "=" in word and not Path(word).is_file()]
    names = iter([word for word in words if word not in settings])
    keys = [word.lstrip("+") for word in settings]  # a run requires ++ for a key that is not set
    for group in names:
        if group not in (ROBOT, WORLD) or group in files:
            raise InputError(
                f"{group}: must be robot FILE or world FILE, each at most once; type: {NAME} robot "
                "FILE"
            )
        file = expand_home(next(names, ""))
        if not file.is_file():
            raise InputError(f"{group} {file}: file not found; correct the path")
        files[group] = file  # keep paths relative, so that the files can be moved together
    if not files:
        raise InputError("no robot or world was given; add robot FILE, world FILE or both")
    drives = [key for key in keys if key.startswith(DRIVE) and ROBOT in files]
    drive = drives[-1].removeprefix(DRIVE) if drives else ""
    chosen = {group: name or choose_name(file, group) for group, file in files.items()}
    prefix = f"{WORLD}.{chosen.get(WORLD)}."
    keys = [
        f"{WORLD}.{key.removeprefix(prefix)}" if key.startswith(prefix) else key
        for key in keys
        if key not in drives
    ]
    if len(files) == 1:
        (group,) = files
        keys = [key.removeprefix(f"{group}.") for key in keys]
        return [Request(group, files[group], chosen[group], parse_keys(keys), drive)]
    values = parse_keys(keys)
    unknown = sorted(set(values) - set(files))
    if unknown:
        raise InputError(f"{unknown[0]}: must start with robot. or world.; add the prefix")
    return [
        Request(group, files[group], chosen[group], values.get(group, {}), drive)
        for group in (ROBOT, WORLD)
    ]


def _describe(request: Request, chosen: Sequence[str], folder: Path) -> "tuple[OwnFile, str, str]":
    """Return the YAML file of a part, the simulator it requires, and the location of its course."""
    from evoros.config.own_files import ROBOT, OwnFile, is_bundled
    from evoros.formats.sdf.reading import SdfOptions
    from evoros.session.course_planning import plan_course
    from evoros.session.inspection import LEVEL, UNEVEN, find_robot

    own_name = request.name
    if is_bundled(request.group, own_name):  # Hydra would load the bundled part instead
        raise InputError(
            f"--name {own_name}: already the name of a bundled {request.group}; choose another name"
        )
    title = f"{own_name}, read from {request.file.name} by evoros inspect."
    if request.group == ROBOT:
        values = {"description": str(request.file), **ROBOT_KEYS, **request.values}
        choices = {"override /drive@drive": request.drive} if request.drive else {}
        if request.drive and "drive" not in request.values:
            del values["drive"]  # the automatic drive has these keys
        return OwnFile(request.group, own_name, title, values, choices), LEVEL, ""
    keys = {entry.name: entry.default for entry in fields(SdfOptions)}  # keys that messages suggest
    values = {"sdf": str(request.file), **keys, "model_paths": [], **request.values}
    try:
        planned = plan_course(values, find_robot(chosen, folder))
    except InputError as error:
        raise InputError(str(error).replace(_PLACEHOLDER, f"world.{own_name}.")) from error
    values["course"] = planned.course
    if not planned.is_level:
        title += f" The ground is not level; use {UNEVEN}."
    simulator = LEVEL if planned.is_level else UNEVEN
    return OwnFile(request.group, own_name, title, values), simulator, planned.reason


def _write_yaml(
    part: "OwnFile", folder: Path, chosen: Sequence[str], simulator: str, reason: str
) -> "Inspection":
    from evoros.analysis.drawing.inspection import draw_robot_picture
    from evoros.analysis.drawing.worlds import draw_world_picture
    from evoros.config.own_files import ROBOT
    from evoros.session.inspection import inspect_robot, inspect_world

    with _kept_if_usable(folder, part):
        if part.group == ROBOT:
            return inspect_robot(part.name, folder, simulator, draw_robot_picture)
        return inspect_world(part.name, folder, chosen, simulator, reason, draw_world_picture)


@contextmanager
def _kept_if_usable(folder: Path, part: "OwnFile") -> Iterator[None]:
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
            f"{path}: already exists; delete it, or choose another with --name or --config-dir"
        ) from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); choose another file"
        ) from error


def _list_written(part: "OwnFile", files: Sequence[Path]) -> str:
    from evoros.config.own_files import is_bundled

    bundled = part.name.removeprefix("my_")
    why = f" (evoros has a {part.group} {bundled})" if is_bundled(part.group, bundled) else ""
    return "\n        ".join([f"written {files[0]}{why}", *map(str, files[1:])])


def _format(inspection: "Inspection", shown: Sequence[str]) -> str:
    here = f"{Path.cwd()}/"  # shortens paths below the current folder
    messages = [text.replace(here, "") for text in inspection.messages if text not in shown]
    rows = [*inspection.rows, *(("note", message) for message in messages)]
    width = max(len(name) for name, _ in rows)
    return "\n".join([inspection.title, *(f"  {name:<{width}}  {text}" for name, text in rows)])

"""The subcommand ``world``: writes a configured world as an SDF file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.base.errors import InputError, escape
from evoros.files.resources import expand_home
from evoros.terminal.console import DONE, CommandParser, print_result, reports_errors, require_keys

NAME = "evoros world"
ABOUT = """Write a generated world as an SDF file, to open in Gazebo or to use as a fixed world.

FILE must not exist. Meshes and height fields are written next to it, in files named after it.
The keys are the same as in a run with world=generated:
  evoros world field.sdf world.generated.seed=3 world.generated.density=0.3"""


@reports_errors(NAME)
def world(arguments: Sequence[str]) -> int:
    """Run the command and return the exit status: 0, or 2 for invalid input."""
    from evoros.config.compose import compose

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("overrides", nargs="*", metavar="key=value")
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder with your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    key, equals, _ = options.file.partition("=")
    if equals and not (key.startswith((".", "/", "~/")) and options.file.endswith(".sdf")):
        raise InputError(
            f"{options.file}: must be the name of a new file; if the name contains =, add its "
            f"folder, as in ./NAME.sdf"
        )
    require_keys(options.overrides, options.file)
    overrides = ["world=generated", *options.overrides]
    worlds = compose(overrides, config_dir=options.config_dir).build().world
    if len(worlds) > 1:
        raise InputError(
            f"world: must be one world, not {len(worlds)} ({', '.join(worlds)}); choose one of them"
        )
    (chosen,) = worlds.values()
    path = expand_home(options.file)
    first, *others = chosen.files(escape(path.stem)).items()
    _write_new({path: first[1], **{path.with_name(other): content for other, content in others}})
    print_result(f"{path}: {len(chosen.obstacles)} obstacles")
    return DONE


def _write_new(files: Mapping[Path, bytes]) -> None:
    for path in files:
        if path.exists():
            raise InputError(f"{path}: already exists; choose another file")
    for path, content in files.items():
        try:
            with path.open("xb") as file:
                file.write(content)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written ({error.strerror}); choose another file"
            ) from error

"""The command ``evoros-world``: writes the world of a configuration as an SDF file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.base.console import DONE, INPUT, print_result, run_main
from evoros.base.errors import EvorosError, InputError, single_line
from evoros.base.log import LOGGER, log_to_terminal
from evoros.base.resources import expand_home

USAGE = """evoros-world writes a world as an SDF file, for Gazebo and for world=... of your own.

evoros-world FILE [key=value ...] [--config-dir FOLDER]

FILE must not exist. Meshes and height fields are written beside it, in files of its name.
The keys are those of evoros, with world=generated chosen:
  evoros-world field.sdf world.generated.seed=3 world.generated.density=0.3"""


def main() -> None:
    """Entry point of the console script."""
    run_main(evoros_world)


def evoros_world(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status: 0, or 2 for input that cannot be used."""
    if not arguments or {"-h", "--help"} & set(arguments):
        print_result(USAGE)
        return DONE if arguments else INPUT
    with log_to_terminal():
        try:
            print_result(_write(arguments[0], arguments[1:]))
        except EvorosError as error:
            LOGGER.error("evoros-world: %s", single_line(error))
            return INPUT
    return DONE


def _write(name: str, rest: Sequence[str]) -> str:
    """Write the file and describe it in one line."""
    from evoros.config.compose import compose
    from evoros.config.options import parse_options

    if "=" in name or name.startswith("-"):
        raise InputError(f"{name}: must be the name of a new file; evoros-world FILE key=value ...")
    options = parse_options(rest)
    worlds = compose(["world=generated", *options.overrides], options.config_dir).build().world
    if len(worlds) > 1:
        raise InputError(
            f"world: must be one world, not {len(worlds)} ({', '.join(worlds)}); choose one of them"
        )
    (world,) = worlds.values()
    path = expand_home(name)
    first, *others = world.files(path.stem).items()
    _write_new({path: first[1], **{path.with_name(other): content for other, content in others}})
    return f"{path}: {len(world.obstacles)} obstacles"


def _write_new(files: Mapping[Path, bytes]) -> None:
    """Write files, of which none may exist."""
    for path in files:
        if path.exists():
            raise InputError(f"{path}: must be a new file, and it exists; choose another")
    for path, content in files.items():
        try:
            with path.open("xb") as file:
                file.write(content)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written ({error.strerror}); choose another"
            ) from error

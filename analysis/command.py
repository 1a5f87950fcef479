"""The command ``evoros-analyze``: from folders of runs to figures, tables and pages."""

import argparse
import io
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NoReturn, Protocol, cast

from evoros.command import DONE, INPUT, INTERRUPTED, show
from evoros.errors import EvorosError, InputError
from evoros.log import LOGGER, logging_to_terminal

from . import SUBCOMMANDS
from .drawing.style import KINDS, save
from .product import Product
from .tables.study import Study, load_study

NAME = "evoros-analyze"
ABOUT = """evoros-analyze turns the folders of runs and evaluations, or sweeps of them, into figures
and the numbers behind them.

What is unfinished or damaged is left out, and said. Exit status: 0 done; 2 input that cannot be
used; 130 interrupted."""


class Subcommand(Protocol):
    """What a module of a subcommand has; ``arguments`` and ``FORMATS`` it may leave out."""

    HELP: str  # one line

    def product(self, study: Study, options: argparse.Namespace) -> Product:
        """What it makes of a study."""
        ...


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros_analyze(sys.argv[1:]))


def evoros_analyze(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit status."""
    with logging_to_terminal():
        try:
            options = parse(arguments)
            for path in draw(options):
                show(str(path))
        except KeyboardInterrupt:
            LOGGER.error("%s: interrupted", NAME)
            return INTERRUPTED
        except EvorosError as error:
            LOGGER.error("%s: %s", NAME, " ".join(str(error).split()))
            return INPUT
    return DONE


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options of one subcommand: also those that it alone has.

    Raises:
        InputError: there is no such subcommand or option.
    """
    chosen = [name for name in SUBCOMMANDS if name in arguments[:1]]
    parser = _Parser(NAME, description=ABOUT, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--version", action="version", version=f"{NAME} {_version()}")
    below = parser.add_subparsers(dest="subcommand", metavar="SUBCOMMAND", required=True)
    for name in chosen or SUBCOMMANDS:
        module = module_of(name)
        each = below.add_parser(name, help=module.HELP, description=module.HELP)
        _add_arguments(each, getattr(module, "FORMATS", KINDS))
        getattr(module, "arguments", lambda parser: None)(each)
    return parser.parse_args(list(arguments))


def _add_arguments(parser: argparse.ArgumentParser, kinds: Sequence[str]) -> None:
    parser.add_argument(
        "folders", nargs="+", type=Path, metavar="FOLDER", help="a run, an evaluation, or a sweep"
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help="where the files go, and replace earlier ones; figures/ in the first folder",
    )
    parser.add_argument("--format", choices=kinds, default=kinds[0], help=f"{kinds[0]}")
    if set(kinds) <= set(KINDS):
        parser.add_argument(
            "--columns", type=int, choices=(1, 2), help="how many columns of a page it spans"
        )


def draw(options: argparse.Namespace, study: Study | None = None) -> list[Path]:
    """Write the files of a subcommand, and say what is to be said; returns their paths.

    Raises:
        InputError: nothing whole is there, an option does not fit, or a file cannot be written.
    """
    folders = [path.expanduser() for path in options.folders]
    if options.output is None:
        options.output = folders[0] / "figures"
    study = study or load_study(folders)
    made = module_of(options.subcommand).product(study, options)
    files = _files(options.subcommand, made, options.format)
    try:
        options.output.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            _write(options.output / name, content)
    except OSError as error:
        raise InputError(
            f"--output {options.output}: cannot be written ({error.strerror}); choose another"
        ) from error
    for line in made.said:
        show(line)
    return [options.output / name for name in files]


def _write(path: Path, content: bytes) -> None:
    """The file has its old content or the new one, also where the disk is full."""
    draft = path.with_name(f".{path.name}.part")
    try:
        draft.write_bytes(content)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def _files(name: str, made: Product, kind: str) -> dict[str, bytes]:
    """All before any is written: what fails leaves nothing behind."""
    files: dict[str, bytes] = {}
    if made.figure is not None:
        picture = io.BytesIO()
        save(made.figure, picture, kind)
        files[f"{name}.{kind}"] = picture.getvalue()
    if made.table is not None:
        files[f"{name}.csv"] = made.table.to_csv(index=False, lineterminator="\n").encode()
    return {**files, **made.files}


def module_of(name: str) -> Subcommand:
    """The module of a subcommand; matplotlib is imported only with it."""
    return cast(Subcommand, import_module(f".{name}", __package__))


def _version() -> str:
    from importlib.metadata import version

    return version("evoros")

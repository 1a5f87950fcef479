"""The command ``evoros-analyze``: from folders of runs to figures, tables and pages."""

import argparse
import io
import sys
from collections.abc import Sequence
from pathlib import Path

from evoros.base.console import DONE, INPUT, INTERRUPTED, print_result
from evoros.base.errors import EvorosError, InputError, single_line
from evoros.base.log import LOGGER, log_to_terminal

from .drawing.style import save
from .product import Product
from .subcommands import NAME, module_of, parse
from .tables.study import Study, load_study


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros_analyze(sys.argv[1:]))


def evoros_analyze(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit status."""
    with log_to_terminal():
        try:
            options = parse(arguments)
            for path in draw(options):
                print_result(str(path))
        except KeyboardInterrupt:
            LOGGER.error("%s: interrupted", NAME)
            return INTERRUPTED
        except EvorosError as error:
            LOGGER.error("%s: %s", NAME, single_line(error))
            return INPUT
    return DONE


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
        print_result(line)
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

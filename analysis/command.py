"""The command ``evoros analyze``: from folders of runs to figures, tables and pages."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.disk import exists, require_no_links, write_atomically
from evoros.files.resources import expand_home
from evoros.storage.archives import find_archive
from evoros.storage.discovery import MARKS
from evoros.terminal.console import print_result, report_errors, run_main

from .drawing.style import choose_style, render
from .own_folder import write_folder
from .product import Product, to_csv
from .robot_choice import make_product
from .subcommands import NAME, import_subcommand, parse
from .tables.loading import load_study
from .tables.study import Study


def main() -> None:
    """Run the console script."""
    run_main(evoros_analyze)


def evoros_analyze(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    return report_errors(NAME, lambda: _analyze(arguments))


def _analyze(arguments: Sequence[str]) -> int:
    paths, status = draw(parse(arguments))
    for path in paths:
        print_result(str(path))
    return status


def draw(options: argparse.Namespace, study: Study | None = None) -> tuple[list[Path], int]:
    """Write the files of a subcommand, print its messages; return the paths and the status.

    Raises:
        InputError: no folder is complete, an option does not fit, or a file cannot be written.
    """
    subcommand = import_subcommand(options.subcommand)
    if options.output is None:
        first = expand_home(options.folders[0])
        archive = find_archive(first)
        if archive is not None:  # it stays as it is
            first = archive.with_name(f"{archive.stem}_analysis")
        if any(exists(first / name) for name in MARKS):
            require_no_links(first)  # the figures may not be written through one
        options.output = first / getattr(subcommand, "OUTPUT", "figures")
    study = study or load_study(options.folders, options.where, options.treatments)
    with choose_style(getattr(options, "style", None)):
        product = make_product(subcommand, study, options)
        try:
            paths = _write_product(product, options)
        except OSError as error:
            raise InputError(
                f"--output {options.output}: cannot be written ({error.strerror}); choose another"
            ) from error
    for message in product.messages:
        print_result(message)
    return paths, product.status


def _write_product(product: Product, options: argparse.Namespace) -> list[Path]:
    """Write the files of a product into the output, and return their paths, or their folders'."""
    if product.folder:
        folder: Path = options.output / product.folder
        write_folder(folder, f"{NAME} {options.subcommand}", product.files)
        return [folder]
    files = _render(product, options)
    options.output.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (options.output / name).parent.mkdir(exist_ok=True)
        write_atomically(options.output / name, content)
    return list(dict.fromkeys(options.output / Path(name).parts[0] for name in files))


def _render(product: Product, options: argparse.Namespace) -> dict[str, bytes]:
    """Render all files before one is written, so that an error leaves no files."""
    files: dict[str, bytes] = {}
    name, kind = options.subcommand, getattr(options, "format", "")
    if product.figure is not None:
        letters = getattr(options, "panel_letters", "")
        files[f"{name}.{kind}"] = render(product.figure, kind, letters=letters)
    if product.table is not None:
        files[f"{name}.csv"] = to_csv(product.table)
    files |= {file: to_csv(table) for file, table in product.tables.items()}
    return {**files, **product.files}

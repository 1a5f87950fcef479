"""The command ``evoros analyze``, which makes figures, tables and pages from run folders."""

import argparse
import hashlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.disk import exists, require_no_links, write_atomically
from evoros.files.resources import expand_home
from evoros.storage.archives import find_archive
from evoros.storage.layout import MARKS
from evoros.terminal.console import print_result, report_errors, run_main

from .drawing.style import choose_style, render
from .products import make_product
from .subcommands import NAME, Product, import_subcommand, parse, to_csv
from .tables.loading import load_study
from .tables.study import Study

RECORD = "evoros.json"  # file in each written folder, with the digests of its other files


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
    """Write the files of a subcommand, print its messages, and return paths and exit status."""
    subcommand = import_subcommand(options.subcommand)
    if options.output is None:
        first = expand_home(options.folders[0])
        archive = find_archive(first)
        if archive is not None:  # archives are never modified
            first = archive.with_name(f"{archive.stem}_analysis")
        if any(exists(first / name) for name in MARKS):
            require_no_links(first)  # prevents figures from being written through a link
        options.output = first / getattr(subcommand, "OUTPUT", "figures")
    study = study or load_study(options.folders, options.where, options.treatments)
    with choose_style(getattr(options, "style", None)):
        product = make_product(subcommand, study, options)
        try:
            paths = _write_product(product, options)
        except OSError as error:
            raise InputError(
                f"--output {options.output}: cannot be written ({error.strerror}); choose another "
                f"folder"
            ) from error
    for message in product.messages:
        print_result(message)
    return paths, product.status


def _write_product(product: Product, options: argparse.Namespace) -> list[Path]:
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
    """Render all files before any is written, so that an error leaves no files behind."""
    files: dict[str, bytes] = {}
    name, kind = options.subcommand, getattr(options, "format", "")
    if product.figure is not None:
        letters = getattr(options, "panel_letters", "")
        files[f"{name}.{kind}"] = render(product.figure, kind, letters=letters)
    if product.table is not None:
        files[f"{name}.csv"] = to_csv(product.table)
    files |= {file: to_csv(table) for file, table in product.tables.items()}
    return {**files, **product.files}


def write_folder(path: Path, command: str, files: Mapping[str, bytes]) -> None:
    """Atomically replace a folder with ``files``, keyed by path, unless a user has modified it."""
    change = _find_change(path, command)
    if change:
        raise InputError(
            f"{path}: must be an unchanged folder from {command} to be replaced, but {change}; "
            f"move the folder away, or choose another --output"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    draft, replaced = (
        path.with_name(f".{path.name}.{os.getpid()}.{kind}") for kind in ("new", "old")
    )
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    record = json.dumps({"command": command, "sha256": hashes}, indent=1) + "\n"
    try:
        for name, content in {**files, RECORD: record.encode()}.items():
            (draft / name).parent.mkdir(parents=True, exist_ok=True)
            (draft / name).write_bytes(content)
        if path.exists():
            path.rename(replaced)
        draft.rename(path)
        shutil.rmtree(replaced, ignore_errors=True)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        if replaced.exists() and not path.exists():
            replaced.rename(path)


def _find_change(path: Path, command: str) -> str:
    """Describe how a folder differs from the command's last output; empty if it does not."""
    if not path.exists() and not path.is_symlink():
        return ""
    if not path.is_dir() or path.is_symlink():
        return "it is not a folder"
    present = {
        str(file.relative_to(path)): file for file in sorted(path.rglob("*")) if not file.is_dir()
    }
    if not present:
        return ""
    try:
        record = json.loads((path / RECORD).read_text(encoding="utf-8"))
        known = dict(record["sha256"]) if record["command"] == command else {}
    except (OSError, ValueError, TypeError, KeyError):
        known = {}
    if not known:
        return f"it has no {RECORD} of that command"
    for name, file in present.items():
        if name != RECORD and name not in known:
            return f"{name} was added"
        if name != RECORD and hashlib.sha256(file.read_bytes()).hexdigest() != known[name]:
            return f"{name} was changed"
    missing = next((name for name in known if name not in present), "")
    return f"{missing} was deleted" if missing else ""

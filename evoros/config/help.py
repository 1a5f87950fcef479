"""Hydra's output for --help, --hydra-help, --cfg, --info and shell completion."""

import io
import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from textwrap import fill

import hydra

from evoros.base.errors import InputError
from evoros.config.configuration import VERSION_BASE
from evoros.config.messages import describe_error
from evoros.config.references import register_resolver
from evoros.files.resources import bundled_folder

WIDTH = 100  # maximum width of help [characters]


def show(
    command: str, primary: str, arguments: Sequence[str], subcommands: Sequence[str] = ()
) -> int:
    """Pass the arguments of a command to Hydra, and return the exit status."""
    register_resolver("evoros.subcommands", lambda: "\n".join(subcommands))
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises errors instead of printing them
    sys.argv = [command, *arguments]
    conf = str(bundled_folder("conf"))
    decorate = hydra.main(**VERSION_BASE, config_path=conf, config_name=primary)
    is_help = not {"--help", "-h"}.isdisjoint(arguments)
    raises, logging.raiseExceptions = logging.raiseExceptions, False  # ignores closed pipes
    try:
        with _wrap_lines() if is_help else nullcontext():
            decorate(lambda config: None)()
    except SystemExit as stop:  # Hydra exits after --help
        return int(stop.code or 0)
    except Exception as error:
        raise InputError(describe_error(error)) from error
    finally:
        logging.raiseExceptions = raises
    return 0


@contextmanager
def _wrap_lines() -> Iterator[None]:
    printed = io.StringIO()
    try:
        with redirect_stdout(printed):
            yield
    finally:
        for line in printed.getvalue().splitlines():
            print(line if len(line) <= WIDTH else fill(line, WIDTH, subsequent_indent="  "))

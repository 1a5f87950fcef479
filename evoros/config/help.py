"""Hydra's output for --hydra-help, --cfg, --info and shell completion."""

import logging
import os
import sys
from collections.abc import Sequence

import hydra

from evoros.base.errors import InputError
from evoros.config.configuration import VERSION_BASE
from evoros.config.messages import describe_error
from evoros.files.resources import bundled_folder


def show(command: str, primary: str, arguments: Sequence[str]) -> int:
    """Pass the arguments of a command to Hydra, and return the exit status."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # makes Hydra raise errors instead of printing them
    sys.argv = [command, *arguments]
    conf = str(bundled_folder("conf"))
    decorate = hydra.main(**VERSION_BASE, config_path=conf, config_name=primary)
    raises, logging.raiseExceptions = logging.raiseExceptions, False  # ignores closed pipes
    try:
        decorate(lambda config: None)()
    except SystemExit as stop:
        return int(stop.code or 0)
    except Exception as error:
        raise InputError(describe_error(error)) from error
    finally:
        logging.raiseExceptions = raises
    return 0

"""The command line's options. This module imports no Hydra, so that parsing is quick."""

from argparse import Action, ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evoros.base.errors import InputError
from evoros.terminal.arguments import CommandParser


@dataclass(frozen=True)
class Options:
    """The arguments of a command."""

    overrides: tuple[str, ...]
    multirun: bool  # a sweep
    config_dir: str | None  # a folder of the user's own groups, experiments and classes
    version: bool
    shows: bool  # Hydra shows something instead: help, the configuration, shell completion ...


def parse_options(arguments: Sequence[str]) -> Options:
    """Parse the arguments of a command, whose options may stand among its overrides."""
    typed = _parser().parse_intermixed_args(list(arguments))
    shown = (typed.help, typed.hydra_help, typed.cfg, typed.info, typed.shell_completion)
    return Options(
        tuple(typed.overrides), typed.multirun, typed.config_dir, typed.version, any(shown)
    )


class _Refuse(Action):
    """An option of Hydra that evoros does not have."""

    def __call__(self, parser: ArgumentParser, *_: Any) -> None:
        raise InputError(
            f"{self.option_strings[0]}: is Hydra's and not evoros's; use experiment= for a study"
        )


def _parser() -> ArgumentParser:
    """Hydra's options; those that Hydra itself handles are parsed again by it (``help.py``)."""
    parser = CommandParser("evoros", add_help=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--config-dir", "-cd")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--help", "-h", action="store_true")
    parser.add_argument("--hydra-help", action="store_true")
    parser.add_argument("--cfg", "-c", choices=["job", "hydra", "all"])
    parser.add_argument("--resolve", action="store_true")  # with --cfg
    parser.add_argument("--package", "-p")  # with --cfg
    parser.add_argument("--shell-completion", "-sc", action="store_true")
    info = ["all", "config", "defaults", "defaults-tree", "plugins", "searchpath"]
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=info)
    for name, short in (("--config-name", "-cn"), ("--config-path", "-cp")):
        parser.add_argument(name, short, action=_Refuse)
    parser.add_argument("--experimental-rerun", action=_Refuse)
    return parser

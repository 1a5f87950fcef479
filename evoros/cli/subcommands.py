"""The subcommands of ``evoros``: their functions, help and options, without their modules."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import cast

from evoros.terminal.console import Command

FIGURES = "analyze"
SIGNS = ("-", "+", "~")
"""Signs with which options and overrides without a value begin."""


@dataclass(frozen=True)
class Subcommand:
    """A subcommand: its function as MODULE:NAME, arguments, help in one line, and options."""

    target: str
    arguments: str
    about: str
    options: tuple[str, ...] = ()
    """Long options besides --help; of ``analyze``, those that all figures have."""

    def load(self) -> Command:
        """Import the function."""
        module, _, name = self.target.partition(":")
        return cast(Command, getattr(import_module(f"evoros.{module}"), name))


COMPOSING = (
    "--multirun",
    "--config-dir",
    "--cfg",
    "--resolve",
    "--package",
    "--info",
    "--hydra-help",
    "--shell-completion",
    "--version",
)
"""Options of the commands that compose a configuration."""
SUBCOMMANDS: Mapping[str, Subcommand] = {
    "evaluate": Subcommand(
        "cli.evaluate:evaluate", "designs=...", "score given designs on fresh draws", COMPOSING
    ),
    "resume": Subcommand(
        "cli.resume:resume",
        "FOLDER",
        "continue what has stopped, or extend a run",
        ("--config-dir",),
    ),
    FIGURES: Subcommand(
        "analysis.command:evoros_analyze",
        "FIGURE FOLDER",
        "draw figures, tables, reports, videos",
        ("--where", "--treatments", "--output"),
    ),
    "status": Subcommand(
        "cli.status:status", "[FOLDER]", "show all runs below a folder as they go on", ("--once",)
    ),
    "watch": Subcommand(
        "watch.command:watch", "FOLDER", "follow runs on a page in the browser", ("--port",)
    ),
    "diff": Subcommand(
        "cli.diff:diff", "A B", "compare the bytes of two runs, or sweeps of them", ("--version",)
    ),
    "reproduce": Subcommand(
        "cli.reproduce:reproduce",
        "FOLDER",
        "run a folder again and compare the bytes",
        ("--output", "--config-dir", "--version"),
    ),
    "leaderboard": Subcommand(
        "cli.leaderboard:leaderboard",
        "FOLDER ...",
        "make rows of the benchmark, or check them",
        ("--check", "--known", "--config-dir"),
    ),
    "archive": Subcommand(
        "cli.archive:archive",
        "FOLDER ...",
        "write a study into one file with all that reproduces it",
        ("--output", "--config-dir", "--license", "--author", "--version"),
    ),
    "replay": Subcommand(
        "cli.replay:replay",
        "FOLDER column=value ...",
        "run one recorded mission again",
        ("--output", "--config-dir"),
    ),
    "export": Subcommand(
        "cli.export:export",
        "TRACKER FOLDER...",
        "send runs to a tracker, where it lacks them",
        ("--config-dir",),
    ),
    "inspect": Subcommand(
        "cli.inspect:inspect",
        "robot FILE world FILE",
        "show how a robot or world is read, write its YAML",
        ("--config-dir", "--name"),
    ),
    "world": Subcommand(
        "cli.world:world", "FILE", "write a generated world as an SDF file", ("--config-dir",)
    ),
}


def find_misuse(arguments: Sequence[str]) -> str:
    """Return why the first arguments of ``evoros`` cannot be used, and the fix; empty if they can.

    Checks the subcommand and that its options are not those of another one.
    """
    for folder in (text[7:] for text in arguments if text.startswith("resume=")):
        return f"resume: must be a subcommand; type: evoros resume {shlex.quote(folder)}"
    word, *others = arguments or [""]
    if word == FIGURES:
        other = next((text for text in others[:1] if text in SUBCOMMANDS), "")
        return other and _explain_figure(other)
    if word in SUBCOMMANDS:
        return _find_foreign_option(word, others)
    return "" if not word or "=" in word or word.startswith(SIGNS) else _explain_word(word)


def _explain_figure(word: str) -> str:
    from evoros.analysis import subcommands as analysis

    if word in analysis.SUBCOMMANDS:  # archives of searches, too, are drawn
        return ""
    return f"{word}: must be a figure; type: evoros {word}"


def _explain_word(word: str) -> str:
    from evoros.analysis import subcommands as analysis

    if Path(word).is_dir():
        return f"{word}: must come after a subcommand; type: evoros resume {shlex.quote(word)}"
    name = word.removeprefix("evoros-")
    close = get_close_matches(name, [*SUBCOMMANDS, *analysis.SUBCOMMANDS], 1)
    if not close:
        names = ", ".join(SUBCOMMANDS)
        return f"{word}: must be key=value or a subcommand ({names}); see evoros --help"
    (meant,) = close
    meant = f"{FIGURES} {meant}" if meant in analysis.SUBCOMMANDS else meant
    return f"{word}: must be key=value or a subcommand; type: evoros {meant}"


def _find_foreign_option(subcommand: str, arguments: Sequence[str]) -> str:
    known = SUBCOMMANDS[subcommand].options
    for option in (text.partition("=")[0] for text in arguments if text.startswith("--")):
        owners = [name for name, other in SUBCOMMANDS.items() if option in other.options]
        if owners and option not in known:
            options = ", ".join([*known, "--help"])
            return (
                f"{option}: is an option of evoros {', '.join(owners)}; evoros {subcommand} has "
                f"{options}; leave it out"
            )
    return ""

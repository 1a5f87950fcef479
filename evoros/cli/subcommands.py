"""The subcommands of ``evoros`` with help and options; their modules are imported on use."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from evoros.base.errors import shell_line
from evoros.files.plugins import Subcommand, explain_missing, find_plugins

FIGURES = "analyze"
SIGNS = ("-", "+", "~")  # first characters of options and of overrides without a value
COMPOSING = (
    *("--multirun", "--config-dir", "--cfg", "--resolve", "--package", "--info"),
    *("--hydra-help", "--shell-completion", "--version"),
)
"""Options of the commands that compose a configuration."""
SUBCOMMANDS: Mapping[str, Subcommand] = {
    "evaluate": Subcommand(
        "evoros.cli.command:evaluate",
        "designs=...",
        "score given designs on fresh draws",
        COMPOSING,
    ),
    "resume": Subcommand(
        "evoros.cli.command:resume",
        "FOLDER",
        "continue a stopped run, or extend a finished run",
        ("--config-dir",),
    ),
    FIGURES: Subcommand(
        "evoros.analysis.command:evoros_analyze",
        "FIGURE FOLDER",
        "draw figures, tables, reports, videos",
        ("--where", "--treatments", "--output"),
    ),
    "show": Subcommand(
        "evoros.cli.show:show",
        "DESIGN",
        "list and draw the sensors of a design",
        ("--design", "--picture", "--browser", "--config-dir"),
    ),
    "status": Subcommand(
        "evoros.cli.status:status",
        "[FOLDER]",
        "show the progress of all runs below a folder",
        ("--once",),
    ),
    "diff": Subcommand(
        "evoros.cli.diff:diff", "A B", "compare two runs or sweeps byte by byte", ("--version",)
    ),
    "replay": Subcommand(
        "evoros.cli.replay:replay",
        "FOLDER column=value ...",
        "run one recorded mission again",
        ("--output", "--config-dir"),
    ),
    "export": Subcommand(
        "evoros.cli.export:export",
        "TRACKER FOLDER...",
        "send recorded runs to a tracker",
        ("--config-dir",),
    ),
    "inspect": Subcommand(
        "evoros.cli.inspect:inspect",
        "robot FILE world FILE",
        "show how a robot or world is read; write its YAML",
        ("--config-dir", "--name"),
    ),
    "world": Subcommand(
        "evoros.cli.world:world",
        "FILE",
        "write a generated world as an SDF file",
        ("--config-dir",),
    ),
} | {
    name: subcommand
    for plugin in find_plugins().values()
    for name, subcommand in plugin.subcommands.items()
}


def find_misuse(arguments: Sequence[str]) -> str:
    """Explain how to correct a wrong subcommand or misplaced option; empty if there is no error."""
    word, *others = arguments or [""]
    for folder in (text[7:] for text in arguments if text.startswith("resume=")):
        return f"resume: a subcommand, not a key; type: {_write_resume(folder)}"
    if word == FIGURES:
        from evoros.analysis import subcommands as analysis

        named = next(iter(others), "")  # a subcommand or a figure; some names are both
        if named in SUBCOMMANDS and named not in analysis.SUBCOMMANDS:
            return f"{named}: a subcommand, not a figure; type: evoros {named}"
        return explain_missing(f"{FIGURES} {named}")
    if word in SUBCOMMANDS:
        return _find_foreign_option(word, others)
    if word and "=" not in word and not word.startswith(SIGNS):
        return _explain_word(word)
    for key in (text.partition("=")[0] for text in arguments):
        if key in ("designs", "like"):
            evaluate = shell_line("evoros", "evaluate", *arguments)
            return f"{key}: only evoros evaluate has this key; type: {evaluate}"
    return ""


def _explain_word(word: str) -> str:
    from evoros.analysis import subcommands as analysis

    missing = explain_missing(word)
    if missing:
        return missing
    if Path(word).is_dir():
        return f"{word}: must come after a subcommand; type: {_write_resume(word)}"
    name = word.removeprefix("evoros-")
    close = get_close_matches(name, [*SUBCOMMANDS, *analysis.SUBCOMMANDS], 1)
    if not close:
        names = ", ".join(SUBCOMMANDS)
        return f"{word}: must be key=value or a subcommand ({names}); see evoros --help"
    (meant,) = close
    meant = f"{FIGURES} {meant}" if meant in analysis.SUBCOMMANDS else meant
    return f"{word}: must be key=value or a subcommand; type: evoros {meant}"


def _write_resume(folder: str) -> str:
    from evoros.storage.layout import resume_command

    return resume_command(Path(folder))


def _find_foreign_option(subcommand: str, arguments: Sequence[str]) -> str:
    known = SUBCOMMANDS[subcommand].options
    for option in (text.partition("=")[0] for text in arguments if text.startswith("--")):
        owners = [name for name, other in SUBCOMMANDS.items() if option in other.options]
        if owners and option not in known:
            options = ", ".join([*known, "--help"])
            return (
                f"{option}: belongs to evoros {', '.join(owners)}, not to evoros {subcommand}, "
                "which has "
                f"{options}; leave out {option}"
            )
    return ""

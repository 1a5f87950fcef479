"""The help of ``evoros`` and ``evoros evaluate``, without Hydra, which imports slowly."""

from collections.abc import Sequence
from pathlib import Path
from string import Template
from textwrap import fill

from evoros.cli.subcommands import SUBCOMMANDS
from evoros.files.plugins import conf_folders

WIDTH = 100  # maximum width of the help [characters]


def format_help(primary: str, config_dir: Path | None) -> str:
    """Return the help of the command whose primary configuration file is ``primary``."""
    folders = [*conf_folders(), *([] if config_dir is None else [config_dir])]
    lines = [
        f"{f'evoros {name} {subcommand.arguments}':<43} {subcommand.about}"
        for name, subcommand in SUBCOMMANDS.items()
    ]
    template = Template(Path(__file__).with_name(f"{primary}.txt").read_text(encoding="utf-8"))
    return template.substitute(groups=_list_groups(folders), subcommands="\n".join(lines))


def _list_groups(folders: Sequence[Path]) -> str:
    choices: dict[str, set[str]] = {}
    for folder in folders:
        for file in folder.rglob("*.yaml"):
            group = file.parent.relative_to(folder).as_posix()
            choices.setdefault(group, set()).add(file.stem)
    lines = [
        f"{group}: {', '.join(sorted(names))}"
        for group, names in sorted(choices.items())
        if group != "." and group.partition("/")[0] != "hydra"
    ]
    return "\n".join(fill(line, WIDTH, subsequent_indent="  ") for line in lines)

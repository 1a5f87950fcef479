"""The page figures.md: the subcommands of ``evoros analyze``, from their modules."""

import argparse
from collections.abc import Mapping

from evoros.analysis.subcommands import (
    EXPORTS,
    FIGURE_FORMATS,
    SUBCOMMANDS,
    Subcommand,
    add_all_arguments,
    import_subcommand,
)
from evoros.files.plugins import find_plugins
from generate import markdown

INTRODUCTION = """# Figures

Every figure, table, video and package that `evoros analyze FIGURE FOLDER...` makes: the folders
that it needs, its options and its files. [Analysis](analysis.md) explains how to read them. In
Python, `evoros.analysis.analyze` has the [same names and options](api_analysis.md#analyze)."""
COMMON = """In a meaning, the text after the last semicolon is the default. `--format`, `--columns`,
`--style` and `--panel-letters` are options of pictures, which are the files `FIGURE.FORMAT`. The
same input gives the same bytes."""
OUTPUT = "the folder for the files, replacing earlier ones; `figures/` in the first folder"


def write_page() -> str:
    """Write the text of the page: a list, the common options, then every subcommand."""
    modules = {name: import_subcommand(name) for name in SUBCOMMANDS}
    rows = [(f"[{name}](#{name})", module.HELP) for name, module in modules.items()]
    common = _list_options(modules["fitness"])  # which has no others
    about = common | {"`--output FOLDER`": OUTPUT}
    return markdown.page(
        [
            INTRODUCTION,
            markdown.table(("figure", "shows"), rows),
            "## Common options",
            COMMON,
            markdown.table(("option", "meaning"), about.items()),
            *(_describe(name, module, common) for name, module in modules.items()),
        ]
    )


def _describe(name: str, module: Subcommand, common: Mapping[str, str]) -> str:
    formats = getattr(module, "FORMATS", FIGURE_FORMATS)
    options = _list_options(module)
    rows = [
        (option, about)
        for option, about in options.items()
        if option not in common and (len(formats) > 1 or not option.startswith("`--format"))
    ]
    drawn = formats is FIGURE_FORMATS and name not in EXPORTS
    files = {f"{name}.FORMAT": "the picture"} if drawn else {}
    listed = "\n".join(
        f"- `{file}`: {about}" for file, about in (files | dict(module.FILES)).items()
    )
    return markdown.join(
        [
            f"## {name}",
            f"{module.HELP[0].upper()}{module.HELP[1:]}. Needs {module.NEEDS}.",
            markdown.table(("option", "meaning"), rows) if rows else "",
            f"Writes into `{getattr(module, 'OUTPUT', 'figures')}/`:\n\n{listed}",
            f"More: {_find_page(name)}",
        ]
    )


def _find_page(name: str) -> str:
    """Return a link to the section of a subcommand: the plug-in's own, or that in Analysis."""
    for plugin in find_plugins().values():
        readme = plugin.folder / "README.md"
        if name in plugin.figures and f"\n## {name}\n" in readme.read_text():
            return f"[its plug-in](../evoros/plugins/{plugin.folder.name}/README.md#{name})"
    return f"[Analysis](analysis.md#{name})"


def _list_options(module: Subcommand) -> dict[str, str]:
    """Map the options of a subcommand, as typed, to their meanings."""
    parser = argparse.ArgumentParser(add_help=False)
    add_all_arguments(parser, module)
    return {
        f"`{_name(action)}`": (action.help or "").replace("<", "&lt;") for action in parser._actions
    }


def _name(action: argparse.Action) -> str:
    if not action.option_strings:
        return f"{action.metavar} ..."
    option = action.option_strings[0]
    if isinstance(action.metavar, tuple):
        return f"{option} {' '.join(action.metavar)}"
    if action.choices is not None:
        names = [str(choice) for choice in action.choices if choice]
        return f"{option} {{{','.join(names)}}}"
    return f"{option} {action.metavar}" if action.metavar else option

"""The page figures.md: the subcommands of ``evoros analyze``, from their modules."""

import argparse
from collections import Counter
from collections.abc import Mapping

from evoros.analysis.subcommands import (
    FIGURE_FORMATS,
    SUBCOMMANDS,
    Subcommand,
    add_all_arguments,
    import_subcommand,
)
from evoros.files.plugins import find_plugins
from generate import markdown

INTRODUCTION = """# Figures

Look up the figures, tables, videos and packages that `evoros analyze FIGURE FOLDER...` creates,
with their options and files. [Analysis](analysis.md) explains how to read them. In Python,
`evoros.analysis.analyze` has the [same names and options](api_analysis.md#analyze)."""
COMMON = """All figures accept the first four options. Figures that draw a picture
(`FIGURE.FORMAT`) accept the others, too. The text after the last semicolon is the default. The
same input gives the same bytes."""
SHARED = "These options are accepted by the figures whose sections name them:"
OUTPUT = "the folder for the files, which replace earlier ones; `figures/` in the first folder"

Options = Mapping[str, str]
"""Options, as typed, to their meanings."""


def write_page() -> str:
    """Write the text of the page: a list, the options of several, then every subcommand."""
    modules = {name: import_subcommand(name) for name in SUBCOMMANDS}
    rows = [(f"[{name}](#{name})", m.HELP, m.NEEDS) for name, m in modules.items()]
    common = _list_options(modules["controls"])  # which has no others
    about = common | {"`--output FOLDER`": OUTPUT}
    special = {name: _list_special(module, common) for name, module in modules.items()}
    taken = Counter(option for options in special.values() for option in options.items())
    shared = {option: about for (option, about), count in taken.items() if count > 1}
    return markdown.page(
        [
            INTRODUCTION,
            markdown.table(("figure", "shows", "needs"), rows),
            "## Common options",
            COMMON,
            markdown.table(("option", "meaning"), about.items()),
            SHARED,
            markdown.table(("option", "meaning"), shared.items()),
            *(_describe(name, module, special[name], shared) for name, module in modules.items()),
        ]
    )


def _list_special(module: Subcommand, common: Options) -> Options:
    formats = getattr(module, "FORMATS", FIGURE_FORMATS)
    return {
        option: about
        for option, about in _list_options(module).items()
        if option not in common and (len(formats) > 1 or not option.startswith("`--format"))
    }


def _describe(name: str, module: Subcommand, options: Options, shared: Options) -> str:
    special = {o: about for o, about in options.items() if shared.get(o) != about}
    also = [f"`{option.strip('`').split()[0]}`" for option in options if option not in special]
    files = ", ".join(f"`{file}`" for file in module.FILES)
    folder = getattr(module, "OUTPUT", "figures")
    where = "" if folder == "figures" else f" in `{folder}/`"
    return markdown.join(
        [
            f"## {name}",
            _list(special),
            f"{'Also accepts' if special else 'Accepts'} {', '.join(also)}." if also else "",
            f"[Files]({_find_page(name)}){where}: {files}",
        ]
    )


def _list(meanings: Mapping[str, str]) -> str:
    return "\n".join(f"- {name}: {about}" for name, about in meanings.items())


def _find_page(name: str) -> str:
    """Return the address of the section that explains a figure, in its plug-in or in Analysis."""
    for plugin in find_plugins().values():
        readme = plugin.folder / "README.md"
        if name in plugin.figures and f"\n## {name}\n" in readme.read_text():
            return f"../evoros/plugins/{plugin.folder.name}/README.md#{name}"
    return f"analysis.md#{name}"


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

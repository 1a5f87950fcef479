"""The subcommand ``show``: lists and draws the sensors of designs."""

import tempfile
import webbrowser
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.base.errors import InputError, write_count
from evoros.files.disk import write_atomically
from evoros.files.resources import expand_home
from evoros.terminal.console import DONE, CommandParser, print_result, reports_errors, require_keys

if TYPE_CHECKING:
    from evoros.analysis.tables.showing import ShownDesign

NAME = "evoros show"
ABOUT = """List the sensors of a design, with their poses, types and prices, and draw them.

SOURCE is a run, a sweep, an evaluation, an archive, or a CSV file of designs:
  evoros show outputs/run                   the champion, or the best design so far
  evoros show outputs/run --design 251      any design of the run
  evoros show designs.csv experiment=mine   a file, with keys as for evoros evaluate"""
MOST_VALUES = 8  # maximum number of evolved values printed per design
FORMATS = ("png", "svg", "pdf")


@reports_errors(NAME)
def show(arguments: Sequence[str]) -> int:
    """Run the command and return the exit status: 0, or 2 for invalid input."""
    from evoros.analysis.drawing.gallery import draw_shown
    from evoros.analysis.drawing.style import render

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("source", metavar="SOURCE")
    parser.add_argument("overrides", nargs="*", metavar="key=value", help="for a CSV file only")
    parser.add_argument("--design", metavar="DESIGN", help="number or name of the design")
    parser.add_argument("--picture", metavar="FILE", type=expand_home, help="a new PNG, SVG or PDF")
    parser.add_argument("--browser", action="store_true", help="open the picture in the browser")
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder with your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    require_keys(options.overrides, options.source)
    _check_picture(options.picture)
    shown = _find(options)
    print_result("\n\n".join(_describe(design) for design in shown))
    if options.picture or options.browser:
        picture = options.picture or Path(tempfile.mkdtemp(prefix="evoros_")) / "designs.svg"
        write_atomically(picture, render(draw_shown(shown), picture.suffix[1:]))
        print_result(f"\npicture: {picture}")
        if options.browser:
            webbrowser.open(picture.resolve().as_uri())
    return DONE


def _find(options: Namespace) -> "list[ShownDesign]":
    from evoros.analysis.tables.showing import find_shown_designs

    source = expand_home(options.source)
    if source.suffix == ".csv" or (source.is_file() and source.suffix != ".zip"):
        shown = _read_table(options.source, options.overrides, options.config_dir)
        return shown if options.design is None else _choose(shown, options.design)
    if options.overrides:
        raise InputError(
            f"{options.overrides[0]}: applies only to a CSV file of designs, because a run records "
            f"its configuration; leave it out"
        )
    return find_shown_designs(source, options.design)


def _read_table(
    source: str, overrides: Sequence[str], config_dir: str | None
) -> "list[ShownDesign]":
    """Read a CSV file of designs with the configuration that ``evoros evaluate`` would use."""
    from evoros.analysis.tables.showing import show_named
    from evoros.config.jobs import Job, Jobs
    from evoros.session.evaluation import read_sources
    from evoros.session.given_designs import read_like
    from evoros.storage.figure_context import describe_experiment

    jobs = list(Jobs(overrides, False, config_dir, "evaluate", read_like))
    first = jobs[0]  # the jobs of a study differ only in failures or draws
    if not isinstance(first, Job):
        raise InputError(first.fault)
    experiment = first.config.build()
    context = describe_experiment(experiment)
    return [
        shown
        for named in read_sources(source, experiment)
        for shown in show_named(f"{named.source}: ", named.name, named.design, context)
    ]


def _check_picture(picture: Path | None) -> None:
    if picture is None:
        return
    if picture.suffix[1:] not in FORMATS:
        raise InputError(
            f"--picture {picture}: must end in one of .{', .'.join(FORMATS)}; change the extension"
        )
    if picture.exists():
        raise InputError(f"--picture {picture}: already exists; choose another file")
    if not picture.parent.is_dir():
        raise InputError(f"--picture {picture}: the folder does not exist; create the folder first")


def _choose(shown: "Sequence[ShownDesign]", name: str) -> "list[ShownDesign]":
    chosen = [design for design in shown if design.name == name]
    if not chosen:
        known = ", ".join(dict.fromkeys(design.name for design in shown))
        raise InputError(f"--design {name}: not found; the designs are {known}")
    return chosen


def _describe(design: "ShownDesign") -> str:
    lines = [design.title, *_list_sensors(design)]
    lines += _list_evolved(design.evolved)
    return "\n  ".join(lines)


def _list_sensors(design: "ShownDesign") -> Iterator[str]:
    if design.sensors.empty:
        yield "no sensors"
        return
    table = design.sensors.round(dict.fromkeys(design.sensors.filter(like="_m"), 3))
    table = table.round(dict.fromkeys(table.filter(like="_deg"), 1)).rename(columns=_write_unit)
    yield from table.to_string(index=False, na_rep="-", float_format="{:g}".format).splitlines()
    price = design.sensors.price.sum()
    yield f"{write_count(len(design.sensors), 'sensor')}, total price {price:g}"


def _list_evolved(evolved: Mapping[str, float]) -> Iterator[str]:
    groups: dict[str, list[float]] = {}
    for key, value in evolved.items():
        start, _, index = key.rpartition(".")
        groups.setdefault(start if index.isdecimal() else key, []).append(value)
    for name, values in groups.items():
        if len(values) > MOST_VALUES:
            yield f"{name}: {len(values)} values from {min(values):.4g} to {max(values):.4g}"
        else:
            yield f"{name}: {', '.join(f'{value:.4g}' for value in values)}"


def _write_unit(column: str) -> str:
    name, _, unit = column.rpartition("_")
    return f"{name} [{unit}]" if name else column

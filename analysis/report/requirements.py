"""One page with the verdicts on requirements and their worst missions: ``requirements.html``."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from markupsafe import Markup

from evoros.base.errors import InputError, single_line
from evoros.storage.layout import replay_command
from evoros.storage.verdicts import name_worst

from ..product import Product
from ..tables.required import Required, list_required, read_worst
from ..tables.study import Study
from .frame import Page, render_page
from .ground import Json
from .playback import PLAYER, encode_shown
from .summary import name_page, summarize, tabulate_versions
from .templates import format_table, render

HELP = "one HTML page with the verdicts on requirements, which plays their worst missions"
NEEDS = "an evaluation with requirements"
FILES = {
    "requirements.html": "the page",
}
FORMATS = {"html": ""}
SCRIPTS = (*PLAYER, "verdicts", "tables")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the size of the missions that can be played."""
    about = "size of the missions in the page, as many as fit, violated requirements first; 10"
    parser.add_argument("--playbacks", type=float, default=10.0, metavar="MB", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the page of evaluations."""
    verdicts = list_required(study)
    playbacks, missing = _encode_worst(verdicts, options.playbacks * 1e6)
    sections = dict(_render_sections(study, verdicts, playbacks, missing))
    page = Page(name_page(options.folders), summarize(study), sections, playbacks)
    message = f"requirements.html: {_count(verdicts)}; {len(playbacks)} missions to be played"
    return Product(messages=[message], files={"requirements.html": render_page(page, SCRIPTS)})


def _count(verdicts: Sequence[Required]) -> str:
    counts = Counter(each.verdict["result"] for each in verdicts)
    return ", ".join(f"{count} {result}" for result, count in counts.items())


def _encode_worst(
    verdicts: Sequence[Required], max_bytes: float
) -> tuple[list[Json], dict[str, None]]:
    """Encode the worst missions of what is not met, and say why others cannot be played."""
    playbacks, missing = list[Json](), dict[str, None]()
    room = max_bytes
    for each in verdicts:
        if each.met:
            continue
        try:
            content = encode_shown(read_worst(each))
        except InputError as error:
            missing[single_line(error)] = None
            continue
        room -= len(content)
        if room < 0:
            missing["Further missions are left out because of their size; see --playbacks."] = None
            break
        label = f"{each.verdict['requirement']}, design {each.verdict['design']}: {each.place}"
        about = {"label": label, "key": each.key, "players": ["verdict"]}
        playbacks.append({**about, "content": content})
    return playbacks, missing


def _render_sections(
    study: Study, verdicts: Sequence[Required], playbacks: Sequence[Json], missing: dict[str, None]
) -> Iterator[tuple[str, Markup]]:
    """Yield the title and the content of each section."""
    yield (
        "Requirements",
        render(
            "requirements.html",
            verdicts=verdicts,
            counts=_count(verdicts),
            played={each["key"] for each in playbacks},
            several=len({each.record.name for each in verdicts}) > 1,
        ),
    )
    worst = [each for each in verdicts if not each.met]
    if worst:
        commands = [
            replay_command(Path(each.record.path.name), name_worst(each.verdict)) for each in worst
        ]
        values = {"played": len(playbacks), "missing": list(missing)}
        yield "Worst missions", render("worst.html", commands=dict.fromkeys(commands), **values)
    versions = format_table(tabulate_versions(study))
    yield "Made with", render("versions.html", versions=versions)

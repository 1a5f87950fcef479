"""A page with verdicts on requirements and the worst missions (``requirements.html``)."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from markupsafe import Markup

from evoros.base.errors import InputError, single_line, write_count
from evoros.requirement.verdict import MET
from evoros.storage.layout import name_parts, replay_command
from evoros.storage.verdicts import Row, name_worst, read_verdicts

from ..subcommands import Product
from ..tables.records import EvaluationRecord
from ..tables.shown import ShownDesign, list_kept, read_champion_shown, show_missions
from ..tables.study import Study
from .frame import Page, format_table, render, render_page
from .playback import PLAYER, Json, encode_shown
from .summary import name_page, summarize, tabulate_versions

HELP = "one HTML page with verdicts on requirements and a player of worst missions"
NEEDS = "an evaluation with requirements"
FILES = ("requirements.html",)
FORMATS = {"html": ""}
SCRIPTS = (*PLAYER, "verdicts", "tables")


@dataclass(frozen=True, eq=False)
class Required:
    """A verdict on a requirement for a design."""

    record: EvaluationRecord
    verdict: Row

    @property
    def met(self) -> bool:
        """True if the requirement is met."""
        return self.verdict["result"] == MET

    @property
    def key(self) -> str:
        """The HTML id of the verdict."""
        names = ("source", "design", "requirement", "level")
        return "/".join([self.record.name, *(self.verdict[name] for name in names)])

    @property
    def place(self) -> str:
        """The trial and world of the worst mission."""
        worst = name_worst(self.verdict)
        return f"trial {worst['trial']} in {worst['world']}"


def _list_required(study: Study) -> list[Required]:
    """List the verdicts of all finished evaluations: violated first, then undecided, then met."""
    tables = study.read_each(study.evaluations, lambda each: read_verdicts(each.path))
    verdicts = [Required(record, row) for record, rows in tables for row in rows]
    if not verdicts:
        raise InputError(
            "requirements: no finished evaluation with requirements was found; "
            "make one with evoros evaluate like=FOLDER requirements=..."
        )
    order = ["violated", "undecided", MET]
    return sorted(verdicts, key=lambda required: order.index(required.verdict["result"]))


def _read_worst(required: Required) -> ShownDesign:
    record, names = required.record, name_worst(required.verdict)
    kept = list_kept(record)
    rows = kept[(kept[[*names]].astype(str) == list(names.values())).all(axis=1)]
    if rows.empty:
        raise InputError(
            f"{record.path}: no trajectory was kept of {required.place}; repeat the "
            f"evaluation without record=none"
        )
    shown = read_champion_shown(show_missions(record, rows.iloc[:1]))
    return replace(shown, design=names["design"])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--playbacks``."""
    about = "size limit for the missions on the page, violated requirements first; default: 10"
    parser.add_argument("--playbacks", type=float, default=10.0, metavar="MB", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make ``requirements.html`` for the evaluations of a study."""
    verdicts = _list_required(study)
    playbacks, missing = _encode_worst(verdicts, options.playbacks * 1e6)
    sections = dict(_render_sections(study, verdicts, playbacks, missing))
    page = Page(name_page(options.folders), summarize(study), sections, playbacks)
    message = (
        f"requirements.html: {_count(verdicts)}; includes {write_count(len(playbacks), 'mission')}"
    )
    return Product(messages=[message], files={"requirements.html": render_page(page, SCRIPTS)})


def _count(verdicts: Sequence[Required]) -> str:
    counts = Counter(each.verdict["result"] for each in verdicts)
    return ", ".join(f"{count} {result}" for result, count in counts.items())


def _encode_worst(
    verdicts: Sequence[Required], max_bytes: float
) -> tuple[list[Json], dict[str, None]]:
    playbacks, missing = list[Json](), dict[str, None]()
    room = max_bytes
    for each in verdicts:
        if each.met:
            continue
        try:
            content = encode_shown(_read_worst(each))
        except InputError as error:
            missing[single_line(error)] = None
            continue
        room -= len(content)
        if room < 0:
            reason = "Further missions are left out to limit the page's size; see --playbacks."
            missing[reason] = None
            break
        names = [each.verdict[name] for name in ("requirement", "level") if each.verdict[name]]
        label = f"{' '.join(names)}, design {each.verdict['design']}: {each.place}"
        about = {"label": label, "key": each.key, "players": ["verdict"]}
        playbacks.append({**about, "content": content})
    return playbacks, missing


def _render_sections(
    study: Study, verdicts: Sequence[Required], playbacks: Sequence[Json], missing: dict[str, None]
) -> Iterator[tuple[str, Markup]]:
    several = len({each.record.name for each in verdicts}) > 1
    shown = {"counts": _count(verdicts), "played": {each["key"] for each in playbacks}}
    yield "Requirements", render("requirements.html", verdicts=verdicts, several=several, **shown)
    worst = [each for each in verdicts if not each.met]
    if worst:
        commands = [
            replay_command(Path(run.name), name_worst(each.verdict), name_parts(run))
            for each in worst
            for run in [each.record.path]
        ]
        values = {"played": len(playbacks), "missing": list(missing)}
        yield "Worst missions", render("worst.html", commands=dict.fromkeys(commands), **values)
    versions = format_table(tabulate_versions(study))
    yield "Made with", render("versions.html", versions=versions)

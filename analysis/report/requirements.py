"""A page with the verdicts on requirements and the worst missions (``requirements.html``)."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from evoros.base.errors import InputError, single_line
from evoros.requirement.verdict import MET
from evoros.storage.layout import name_parts, replay_command
from evoros.storage.trajectory_files import trajectory_file
from evoros.storage.verdicts import Row, name_worst, read_verdicts

from ..subcommands import Product
from ..tables.designs import adapt_types, place_sensors, place_signals
from ..tables.records import EvaluationRecord
from ..tables.shown import ShownDesign, ShownMission
from ..tables.study import Study
from ..tables.tracks import find_mission_world, load_mission_world, select_robot
from .frame import Page, format_table, render, render_page
from .playback import PLAYER, Json, encode_shown
from .summary import name_page, summarize, tabulate_versions

GENERATION = 0
"""The generation number of all missions of an evaluation."""
HELP = "one HTML page with verdicts on requirements and a player of worst missions"
NEEDS = "an evaluation with requirements"
FILES = {"requirements.html": "the page"}
FORMATS = {"html": ""}
SCRIPTS = (*PLAYER, "verdicts", "tables")


@dataclass(frozen=True, eq=False)
class Required:
    """A verdict on a requirement of a design."""

    record: EvaluationRecord
    verdict: Row

    @property
    def met(self) -> bool:
        """True if the requirement is met."""
        return self.verdict["result"] == MET

    @property
    def key(self) -> str:
        """The verdict's HTML id."""
        names = ("source", "design", "requirement", "level")
        return "/".join([self.record.name, *(self.verdict[name] for name in names)])

    @property
    def place(self) -> str:
        """A description of the worst mission."""
        worst = name_worst(self.verdict)
        return f"trial {worst['trial']} in {worst['world']}"


def list_required(study: Study) -> list[Required]:
    """List the verdicts of all finished evaluations: violated, then undecided, then met."""
    tables = study.read_each(study.evaluations, lambda each: read_verdicts(each.path))
    verdicts = [Required(record, row) for record, rows in tables for row in rows]
    if not verdicts:
        raise InputError(
            "requirements: no finished evaluation with requirements was found; "
            "make one with evoros evaluate like=FOLDER requirements=..."
        )
    order = ["violated", "undecided", MET]
    return sorted(verdicts, key=lambda required: order.index(required.verdict["result"]))


def read_worst(required: Required) -> ShownDesign:
    """Read the design and the worst mission of a verdict."""
    record, columns = required.record, name_worst(required.verdict)
    missions = record.run.missions
    chosen = pd.concat(
        [missions[name].astype(str) == text for name, text in columns.items()], axis=1
    )
    row = missions[chosen.all(axis=1)].iloc[0]
    key = ["source", "design"]
    mounts = record.mounts.astype(dict.fromkeys(key, str))
    designs = list(mounts.groupby(key, sort=False).groups)
    number = designs.index((columns["source"], columns["design"]))
    mission = (GENERATION, number, columns["world"], int(columns["trial"]))
    if not (record.path / trajectory_file(mission)).is_file():
        raise InputError(
            f"{record.path}: no trajectory was kept of {required.place}; repeat the "
            f"evaluation without record=none"
        )
    trajectory = record.run.mission_trajectory(*mission)
    world = load_mission_world(record.run, record.context, row)
    ground = f"{record.name}/{find_mission_world(record.run, row).stem}"
    genes = record.genes.astype(dict.fromkeys(key, str))
    own, values = (
        select_robot(table[(table[key] == [columns[name] for name in key]).all(axis=1)])
        for table in (mounts, genes)
    )
    context = adapt_types(record.context, dict(zip(values["key"], values["value"], strict=True)))
    return ShownDesign(
        record,
        columns["design"],
        context,
        place_sensors(own, context),
        place_signals(own, context),
        [ShownMission(row, trajectory, world, ground)],
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--playbacks``."""
    about = "size limit for the missions on the page, violated requirements first; default: 10"
    parser.add_argument("--playbacks", type=float, default=10.0, metavar="MB", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make ``requirements.html`` for the evaluations of a study."""
    verdicts = list_required(study)
    playbacks, missing = _encode_worst(verdicts, options.playbacks * 1e6)
    sections = dict(_render_sections(study, verdicts, playbacks, missing))
    page = Page(name_page(options.folders), summarize(study), sections, playbacks)
    message = f"requirements.html: {_count(verdicts)}; includes {len(playbacks)} missions"
    return Product(messages=[message], files={"requirements.html": render_page(page, SCRIPTS)})


def _count(verdicts: Sequence[Required]) -> str:
    counts = Counter(each.verdict["result"] for each in verdicts)
    return ", ".join(f"{count} {result}" for result, count in counts.items())


def _encode_worst(
    verdicts: Sequence[Required], max_bytes: float
) -> tuple[list[Json], dict[str, None]]:
    """Encode the worst missions of unmet requirements; also return why some are missing."""
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
            missing["Further missions are left out to limit the page's size; see --playbacks."] = (
                None
            )
            break
        names = [each.verdict[name] for name in ("requirement", "level") if each.verdict[name]]
        label = f"{' '.join(names)}, design {each.verdict['design']}: {each.place}"
        about = {"label": label, "key": each.key, "players": ["verdict"]}
        playbacks.append({**about, "content": content})
    return playbacks, missing


def _render_sections(
    study: Study, verdicts: Sequence[Required], playbacks: Sequence[Json], missing: dict[str, None]
) -> Iterator[tuple[str, Markup]]:
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
            replay_command(Path(run.name), name_worst(each.verdict), name_parts(run))
            for each in worst
            for run in [each.record.path]
        ]
        values = {"played": len(playbacks), "missing": list(missing)}
        yield "Worst missions", render("worst.html", commands=dict.fromkeys(commands), **values)
    versions = format_table(tabulate_versions(study))
    yield "Made with", render("versions.html", versions=versions)

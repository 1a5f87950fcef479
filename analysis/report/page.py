"""One page of a study that opens in any browser, without a network: ``report.html``."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from ..product import Product
from ..subcommands import EXPORTS, SUBCOMMANDS
from ..tables.records import Record
from ..tables.shown import keeps_shown
from ..tables.study import Study
from .design_map import DesignMap
from .findings import list_findings
from .frame import Page, render_page
from .ground import Json
from .map_missions import Missions, collect_missions
from .maps import TITLES, make_maps
from .outline import common_choices, outline, tabulate_differences
from .playback import PLAYER, Flown, select_playbacks
from .section import make_section
from .summary import (
    label_runs,
    name_page,
    summarize,
    tabulate_evaluations,
    tabulate_runs,
    tabulate_versions,
)
from .templates import format_table, render

HELP = "one HTML page with everything, and the champions' missions to be played"
NEEDS = "runs or evaluations"
FILES = {
    "report.html": "the page",
}
FORMATS = {"html": ""}
CLAIMS = "claims"
LEFT_OUT = {"report", "requirements", "video", "power", "regression", CLAIMS, *EXPORTS}
FIGURES = tuple(name for name in SUBCOMMANDS if name not in LEFT_OUT)
"""The subcommands whose results are in the page; claims are if they are asked for."""
OWN_SECTION = {"compare": "Statistics", CLAIMS: "Claims"}
"""The titles of the subcommands with sections of their own; the others are under Figures."""
SCRIPTS = (*PLAYER, "maps", "tables")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the size of the missions that can be played."""
    about = (
        "size of the missions in the page: the best run of each treatment, which is always "
        "included, then the others, as far as they fit; about 0.3 a run; 3"
    )
    parser.add_argument("--playbacks", type=float, default=3.0, metavar="MB", help=about)
    about = (
        "size of the missions of designs in an archive and a front, as many as fit, from one "
        "that lies apart to the next; about 0.04 a design; 3"
    )
    parser.add_argument("--designs", type=float, default=3.0, metavar="MB", help=about)
    about = "also judge claims: your own in a YAML file, or the word paper for the 2018 paper's"
    parser.add_argument("--claims", metavar="FILE", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the page of a study as a file."""
    page = make_page(study, options)
    content = render_page(page, SCRIPTS)
    played = sum("run" in each["players"] for each in page.playbacks)
    message = f"missions of {played} of {len(study.records)} runs"
    if len(page.playbacks) > played:
        message += f" and {len(page.playbacks) - played} other designs"
    message = f"report.html: {len(content) / 1e6:.1f} MB, with the {message} to be played"
    return Product(messages=[message], files={"report.html": content})


def make_page(study: Study, options: argparse.Namespace, flown: Flown | None = None) -> Page:
    """Make the page of a study, with missions that unfinished runs have not kept, if given."""
    flown = flown or Flown()
    playbacks = select_playbacks(study, options.playbacks * 1e6, flown.playbacks)
    maps = make_maps(study, options)
    missions = collect_missions(maps, study, options.designs * 1e6)
    player = _render_player(study, playbacks, flown)
    return Page(
        name_page(options.folders),
        summarize(study),
        dict(_render_sections(study, options, player, maps, missions)),
        [*_list_playbacks(study, playbacks), *missions.list_playbacks()],
        missions.grounds,
    )


def _render_player(study: Study, playbacks: Mapping[str, Markup], flown: Flown) -> Markup:
    """Render the player of runs, and why others have no missions in it."""
    kept = sum(keeps_shown(run) or run.name in flown.playbacks for run in study.records)
    counts = {"played": len(playbacks), "others": kept - len(playbacks)}
    return render("player.html", without=len(study.records) - kept, notes=flown.notes, **counts)


def _list_playbacks(study: Study, playbacks: Mapping[str, Markup]) -> Iterator[Json]:
    """Yield the missions of the champions and of the best so far, for the templates."""
    labels = label_runs(study.records)
    for name, content in playbacks.items():
        yield {"label": labels[name], "content": content, "players": ["run"], "key": name}


def _render_sections(
    study: Study,
    options: argparse.Namespace,
    player: Markup,
    maps: Mapping[str, DesignMap],
    missions: Missions,
) -> Iterator[tuple[str, Markup]]:
    """Yield the title and the content of each section."""
    runs, evaluations = study.records, study.evaluations
    findings, missing = list_findings(study)
    yield "Findings", render("findings.html", findings=findings, missing=missing)
    mapped = list(dict.fromkeys(chosen.name for chosen in maps.values()))
    separate = {*OWN_SECTION, *mapped}
    made = {name: make_section(name, study, options) for name in FIGURES}
    drawn = {name: section.render(name in separate) for name, section in made.items()}
    yield OWN_SECTION["compare"], drawn["compare"]
    shown = [name for name in FIGURES if name not in separate]
    empty = {name: made[name].missing for name in shown if made[name].missing}
    figures = [drawn[name] for name in shown if name not in empty]
    yield "Figures", Markup("\n").join([*figures, render("empty.html", empty=empty)])
    for name in mapped:
        own = [missions.render(chosen) for chosen in maps.values() if chosen.name == name]
        yield TITLES[name], Markup("\n").join((*own, drawn[name]))
    yield "Player", player
    if options.claims is not None:
        yield OWN_SECTION[CLAIMS], make_section(CLAIMS, study, options).render(True)
    yield (
        "Summary",
        render(
            "summary.html",
            runs=format_table(tabulate_runs(runs)) if runs else None,
            evaluations=format_table(tabulate_evaluations(evaluations)) if evaluations else None,
            left_out=study.left_out,
        ),
    )
    groups: dict[str, Sequence[Record]] = {"Runs": runs, "Evaluations": evaluations}
    configured = {name: _configure(records) for name, records in groups.items() if records}
    yield "Configuration", render("configuration.html", groups=configured)
    versions = format_table(tabulate_versions(study))
    yield "Made with", render("versions.html", versions=versions)


def _configure(records: Sequence[Record]) -> dict[str, Any]:
    """Return what differs between treatments of runs or evaluations, the rest, and their files."""
    first = {record.treatment: record for record in reversed(records)}
    differences = tabulate_differences(records)
    varied = {*differences["key"], *(["seed"] if len(records) > 1 else [])}
    common = {key: value for key, value in records[0].values.items() if key not in varied}
    treatments = dict.fromkeys(record.treatment for record in records)
    files = {
        first[name].name: (first[name].path / "config.yaml").read_text(
            encoding="utf-8", errors="replace"
        )
        for name in treatments
    }
    return {
        "differences": format_table(differences) if len(differences) else None,
        "common": outline(common, common_choices(records)),
        "files": files,
    }

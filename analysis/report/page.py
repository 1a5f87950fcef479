"""A report on a study as one HTML page, ``report.html``, which needs no network."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import pandas as pd
from markupsafe import Markup

from evoros.base.errors import write_count

from ..drawing.gallery import choose_apart
from ..subcommands import EXPORTS, SUBCOMMANDS, Product
from ..tables.factors import IGNORED, TARGET, Choices, Values, format_value, name_part
from ..tables.records import Record
from ..tables.shown import keeps_shown, read_shown
from ..tables.study import Study
from . import summary
from .frame import Page, format_table, make_section, render, render_page
from .maps import TITLES, DesignMap, make_maps
from .playback import PLAYER, Flown, Json, encode_shown, select_playbacks

MAX_RECORDS = 300  # maximum number of samples per mission, for designs on maps


@dataclass
class Missions:
    """The missions of designs on the page, and the grounds shared by these missions."""

    playbacks: dict[tuple[str, int], Markup] = field(default_factory=dict)  # keyed by (run, design)
    maps: dict[tuple[str, int], list[str]] = field(default_factory=dict)  # map keys by design
    labels: dict[tuple[str, int], str] = field(default_factory=dict)
    grounds: dict[str, Json] = field(default_factory=dict)

    def list_playbacks(self) -> Iterator[Json]:
        """Yield the missions of the designs as template data."""
        for key, content in self.playbacks.items():
            about = {"label": self.labels[key], "key": f"{key[0]}/{key[1]}"}
            yield {**about, "content": content, "players": self.maps[key]}

    def render(self, chosen: DesignMap) -> Markup:
        """Render a map, with a player for its designs."""
        keys = [(record.name, design) for record, design in chosen.designs]
        playable = [key in self.playbacks for key in keys]
        return render("map.html", map=chosen, playable=playable, played=sum(playable))


def collect_missions(maps: Mapping[str, DesignMap], study: Study, max_bytes: float) -> Missions:
    """Encode missions of designs, taking one per map in turn, up to ``max_bytes``."""
    missions = Missions()
    size = 0
    for map_key, index in _take_turns(maps):
        chosen = maps[map_key]
        record, design = chosen.designs[index]
        key = (record.name, design)
        if key not in missions.playbacks:
            shown = dict(study.read_each([record], partial(read_shown, design=design)))
            data = encode_shown(shown[record], MAX_RECORDS, missions.grounds) if shown else None
            if data is None:
                continue
            if size + len(data) > max_bytes:
                break
            size += len(data)
            missions.playbacks[key] = data
            missions.labels[key] = chosen.marks[index].name
        missions.maps.setdefault(key, []).append(map_key)
    return missions


def _take_turns(maps: Mapping[str, DesignMap]) -> Iterator[tuple[str, int]]:
    orders = {}
    for name, chosen in maps.items():
        playable = [i for i, mark in enumerate(chosen.marks) if mark.playable]
        apart = choose_apart(chosen.points[playable], len(playable)) if playable else []
        orders[name] = [playable[i] for i in apart]
    for turn in range(max(map(len, orders.values()), default=0)):
        for name, order in orders.items():
            yield from ((name, i) for i in order[turn : turn + 1])


HELP = "one HTML page with all results, in which the champions' missions can be played"
NEEDS = "runs or evaluations"
FILES = ("report.html",)
FORMATS = {"html": ""}
CLAIMS = "claims"
LEFT_OUT = {"report", "requirements", "video", "power", "regression", CLAIMS, *EXPORTS}
FIGURES = tuple(name for name in SUBCOMMANDS if name not in LEFT_OUT)
OWN_SECTION = {"compare": "Statistics", CLAIMS: "Claims"}  # other subcommands are in "Figures"
SCRIPTS = (*PLAYER, "maps", "tables")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--playbacks``, ``--designs`` and ``--claims``."""
    about = (
        "size limit for the missions on the page; about 0.3 MB per run; the best run of each "
        "treatment is included even beyond the limit; default: 3"
    )
    parser.add_argument("--playbacks", type=float, default=3.0, metavar="MB", help=about)
    about = (
        "size limit for the missions of designs in archives and fronts; about 0.04 MB per "
        "design; default: 3"
    )
    parser.add_argument("--designs", type=float, default=3.0, metavar="MB", help=about)
    about = "also judge the claims in a YAML file, or the 2018 paper's claims if FILE is paper"
    parser.add_argument("--claims", metavar="FILE", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make ``report.html`` for a study."""
    page = make_page(study, options)
    content = render_page(page, SCRIPTS)
    played = sum("run" in each["players"] for each in page.playbacks)
    message = f"missions of {played} of {len(study.records)} runs"
    if len(page.playbacks) > played:
        message += f" and {write_count(len(page.playbacks) - played, 'other design')}"
    message = f"report.html: {len(content) / 1e6:.1f} MB; includes the {message}"
    return Product(messages=[message], files={"report.html": content})


def make_page(study: Study, options: argparse.Namespace, flown: Flown | None = None) -> Page:
    """Make the page about a study; ``flown`` adds missions that unfinished runs have not stored."""
    flown = flown or Flown()
    playbacks = select_playbacks(study, options.playbacks * 1e6, flown.playbacks)
    maps = make_maps(study, options)
    missions = collect_missions(maps, study, options.designs * 1e6)
    kept = sum(keeps_shown(run) or run.name in flown.playbacks for run in study.records)
    counts = {"played": len(playbacks), "others": kept - len(playbacks)}
    without = len(study.records) - kept
    player = render("player.html", without=without, notes=flown.notes, **counts)
    labels = summary.label_runs(study.records)
    champions = [
        {"label": labels[name], "content": content, "players": ["run"], "key": name}
        for name, content in playbacks.items()
    ]
    return Page(
        summary.name_page(options.folders),
        summary.summarize(study),
        dict(_render_sections(study, options, player, maps, missions)),
        [*champions, *missions.list_playbacks()],
        missions.grounds,
    )


def _render_sections(
    study: Study,
    options: argparse.Namespace,
    player: Markup,
    maps: Mapping[str, DesignMap],
    missions: Missions,
) -> Iterator[tuple[str, Markup]]:
    runs, evaluations = study.records, study.evaluations
    findings, missing = summary.list_findings(study)
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
    tables = {
        "runs": runs and format_table(summary.tabulate_runs(runs)),
        "evaluations": evaluations and format_table(summary.tabulate_evaluations(evaluations)),
    }
    yield "Summary", render("summary.html", **tables, left_out=study.left_out)
    groups: dict[str, Sequence[Record]] = {"Runs": runs, "Evaluations": evaluations}
    configured = {name: _configure(records) for name, records in groups.items() if records}
    yield "Configuration", render("configuration.html", groups=configured)
    versions = format_table(summary.tabulate_versions(study))
    yield "Made with", render("versions.html", versions=versions)


def _configure(records: Sequence[Record]) -> dict[str, Any]:
    first = {record.treatment: record for record in reversed(records)}
    differences = _tabulate_differences(records)
    varied = {*differences["key"], *(["seed"] if len(records) > 1 else [])}
    common = {key: value for key, value in records[0].values.items() if key not in varied}
    choices = dict(set.intersection(*(set(record.choices.items()) for record in records)))
    treatments = dict.fromkeys(record.treatment for record in records)
    files = {first[name].name: first[name].path / "config.yaml" for name in treatments}
    return {
        "differences": format_table(differences) if len(differences) else None,
        "common": outline(common, choices),
        "files": {name: file.read_text("utf-8", "replace") for name, file in files.items()},
    }


def outline(values: Values, choices: Choices) -> list[tuple[str, str, str]]:
    """List the key, name and values of each part except the executor; others are in ``run``."""
    parts: dict[str, dict[str, Any]] = {}
    loose: dict[str, Any] = {}
    for key, value in values.items():
        first, _, below = key.partition(".")
        if first in ("executor", "figures"):
            continue
        if below:
            parts.setdefault(first, {})[below] = value
        elif first != TARGET:
            loose[first] = value
    rows = [_outline_part(key, inner, values, choices) for key, inner in parts.items()]
    return [*rows, ("run", "", _join(loose))]


def _outline_part(
    part: str, inner: Values, values: Values, choices: Choices
) -> tuple[str, str, str]:
    """Return a part's key, name and values: names of nested parts, keys of sets of parts."""
    values_here = {key: value for key, value in inner.items() if "." not in key and key != TARGET}
    below: dict[str, dict[str, None]] = {}
    for key in inner:
        first, *others = key.split(".")
        if others:
            below.setdefault(first, {})[others[0]] = None
    if TARGET not in inner:
        return part, "", "; ".join(filter(None, [_join(values_here), ", ".join(below)]))
    texts = [_join(values_here)]
    for name, keys in below.items():
        is_part = f"{name}.{TARGET}" in inner
        inside = name_part(f"{part}.{name}", values, choices) if is_part else ", ".join(keys)
        texts.append(f"{name}: {inside}")
    return part, name_part(part, values, choices), "; ".join(filter(None, texts))


def _join(values: Values) -> str:
    given = {key: value for key, value in values.items() if value not in ({}, [], "")}
    return ", ".join(f"{key} {format_value(value)}" for key, value in given.items())


def _tabulate_differences(records: Sequence[Record]) -> pd.DataFrame:
    first: Mapping[str, Values] = {r.treatment: r.values for r in reversed(records)}
    treatments = list(dict.fromkeys(record.treatment for record in records))
    keys = dict.fromkeys(key for name in treatments for key in first[name])
    rows = []
    for key in keys:
        cells = [
            format_value(first[name][key]) if key in first[name] else "" for name in treatments
        ]
        if len(set(cells)) > 1 and key.split(".")[0] not in IGNORED:
            rows.append([key, *cells])
    return pd.DataFrame(rows, columns=["key", *treatments])

"""The paper's findings, a row each: what was measured, how sure it is, and a verdict by a rule.

``docs/claims.md`` has the measures and the rules.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace

import pandas as pd
from matplotlib.figure import Figure

from ..drawing.claims_table import claims_table, value_of
from ..drawing.style import PAGE_IN
from ..drawing.style import width as width_of
from ..measures import claims_designs, claims_runs
from ..measures.coverage import DESIGN, HEADINGS_DEG
from ..measures.design_features import traits
from ..measures.finding import Finding
from ..measures.heading_swing import champion_sweeps
from ..measures.pairs import paper_rings
from ..measures.spread import diversity
from ..product import Product
from ..tables.designs import champion_or_none, initial_sensors
from ..tables.matching import champion_content, champion_genes, conditions
from ..tables.records import Record, Scored
from ..tables.study import Study
from ..tables.treatments import part_name, repeated
from ..tables.validated import evaluated
from .strategies import arguments, check_near, damage, finished

HELP = "the paper's findings: what was measured, how sure it is, and what it supports"
READ: tuple[Callable[[Record], object], ...] = (
    champion_content,
    champion_or_none,
    initial_sensors,
    champion_sweeps,
    diversity,
    claims_runs.gains,
)
"""What a run must have to count."""
__all__ = ["HELP", "arguments", "claims", "product"]
NO_DESIGNS = pd.DataFrame(
    columns=[*DESIGN, "random", "strategy", "redundant", "closest_m", "kind", *HEADINGS_DEG]
).astype({"random": bool, "redundant": bool})


def product(study: Study, options: argparse.Namespace) -> Product:
    """Of all finished runs in the study, and of the evaluations of their champions."""
    check_near(options)
    whole = finished(study, *READ)
    table = pd.DataFrame([asdict(each) for each in findings(whole, options)])
    figure = claims(table, width_of(options.columns, 2))
    again = repeated((each.name, each.treatment, each.seed) for each in whole.records)
    return Product(table, figure, [*again, *_mixed(whole), *map(_said, table.itertuples())])


def claims(table: pd.DataFrame, width: float = PAGE_IN) -> Figure:
    """A picture of a table with the fields of ``Finding``; ``width`` is in inches."""
    return claims_table(table, width)


def findings(study: Study, options: argparse.Namespace) -> Iterator[Finding]:
    """All of them, of finished runs."""
    mirrored = _only(study, [record for record in study.records if record.setting.mirrored])
    free = _only(study, [record for record in study.records if not record.setting.mirrored])
    designs, alone = _designs(mirrored, options), _designs(free, options)
    yield claims_designs.configurations(designs)
    yield claims_designs.redundancy(designs)
    for ring in damage(study) or paper_rings():
        yield claims_designs.damage(designs, ring.radius_m)
    gains = _gathered(mirrored, claims_runs.gains)
    for line in claims_runs.GAIN:
        yield claims_runs.gain(gains, line)
    yield claims_runs.approach(gains)
    yield claims_runs.sweep(_gathered(mirrored, champion_sweeps))
    yield from claims_runs.completed(missions(study))
    kinds = {kind(record) for record in free.records}
    alike = _only(study, [record for record in mirrored.records if kind(record) in kinds])
    yield claims_designs.spread_between(designs[designs.kind.isin(kinds)], alone)
    yield claims_designs.spread_within(_gathered(alike, diversity), _gathered(free, diversity))


def kind(record: Record) -> str:
    """Of its failure: none, random, spatial; of any other the module that has it."""
    name = part_name(record.values.get("failure._target_", ""))
    return claims_designs.SPATIAL if record.setting.rings and name != "combined" else name


def missions(study: Study) -> pd.DataFrame:
    """A row for each mission of champions on fresh draws, under the failure that they evolved with.

    Columns: ``draws``, their key; the others as ``claims_runs.completed`` has them.
    """
    evaluations = evaluated(study)
    frames = []
    for record in study.records:
        own = record.run.missions
        best = record.run.champion.design.iloc[0]
        own = own[(own.purpose == "validation") & (own.design == best)]
        flown = [("validated in the run", own)]
        for scored, found in evaluations:
            if _alike(scored, record):
                name = f"evaluated in {part_name(scored.values.get('simulator._target_', ''))}"
                flown.append((name, _flown(scored, found, record)))
        for source, rows in flown:
            marks = {"kind": kind(record), "source": source, "run": record.name}
            hit = rows.failed_sensors.notna()
            outcome = {"failed": hit, "completed": rows.completed, "draws": rows.draws}
            frames.append(pd.DataFrame({**marks, **outcome}))
    # Two evaluations with the same seed fly the same missions: each counts once.
    table = pd.concat(frames, ignore_index=True)
    return table.drop_duplicates(["source", "run", "draws"], ignore_index=True)


def _flown(scored: Scored, found: pd.DataFrame, record: Record) -> pd.DataFrame:
    """The missions that an evaluation flew with a run's champion."""
    content = champion_content(record)
    mine = found[[each == content for each in found["content"]]]
    keys = set(zip(mine.source.astype(str), mine.design.astype(str), strict=True))
    flown = scored.missions
    names = zip(flown.source.astype(str), flown.design.astype(str), strict=True)
    return flown[[name in keys for name in names]]


def _alike(scored: Scored, record: Record) -> bool:
    """Whether an evaluation flew under the conditions of a run, in whatever simulator."""
    one, other = conditions(scored), conditions(record)
    keys = {*one, *other} - set(champion_genes(record))
    return all(one.get(k) == other.get(k) for k in keys if not k.startswith("simulator."))


def _only(study: Study, records: Sequence[Record]) -> Study:
    return replace(study, records=tuple(records))


def _gathered(study: Study, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
    """The tables of all runs; without rows where none has any: they can all be read."""
    nothing = pd.DataFrame(columns=["first", "last"])
    found = [table for record in study.records if len(table := read(record))]
    return Study(study.records).gather(read) if found else nothing


def _designs(study: Study, options: argparse.Namespace) -> pd.DataFrame:
    """The traits of champions and random designs, with the kind of their failure."""
    if not study.records:
        return NO_DESIGNS
    champions, initial = study.gather(champion_or_none), study.gather(initial_sensors)
    table = traits(champions, initial, damage(study), options.near_m, options.near_deg)
    return table.assign(kind=table.run.map({each.name: kind(each) for each in study.records}))


def _mixed(study: Study) -> Iterator[str]:
    """Where one kind of failure was studied under several conditions, that is said."""
    for name in dict.fromkeys(map(kind, study.records)):
        mine = [each for each in study.records if kind(each) == name and each.setting.mirrored]
        labels = dict.fromkeys(each.treatment for each in mine)
        if len(labels) > 1:
            yield f"failure {name}: runs of several treatments together: {'; '.join(labels)}"


def _said(row: object) -> str:
    return f"{row.verdict}: {row.claim}: {row.measure}: {value_of(row)} ({row.why})"  # type: ignore[attr-defined]

"""The claims of the paper, or of a file, a row each; ``docs/claims.md`` has the rules."""

import argparse
from collections.abc import Callable, Iterator

import pandas as pd

from ..designs.coverage import DESIGN, HEADINGS_DEG
from ..designs.features import describe_designs
from ..designs.pairs import paper_rings
from ..figures import claims as own_claims
from ..figures.options import check_thresholds
from ..product import Product
from ..statistics.finding import Finding
from ..tables.candidates import read_initial_sensors
from ..tables.champion_missions import classify_failure, list_missions, list_random_missions
from ..tables.champions import read_champion
from ..tables.records import Record
from ..tables.study import Study
from . import claims_designs, claims_runs
from .heading_swing import read_champion_swings
from .spread import read_diversity

FIRST_ROBOT = own_claims.FIRST_ROBOT
HELP = "claims: measured values, their intervals, and which claims they support"
NEEDS = "finished runs"
FILES = {
    "claims.csv": "a row for each claim",
}
WEAVING = ".Serpentine"
"""The end of the class of a navigation that weaves by itself."""
_NO_DESIGNS = pd.DataFrame(
    columns=[*DESIGN, "random", "strategy", "redundant", "closest_m", "kind", *HEADINGS_DEG]
).astype({"random": bool, "redundant": bool})


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``own_claims``."""
    own_claims.add_arguments(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Judge the claims by all finished runs of the study and evaluations of their champions."""
    if options.claims is not None:
        return own_claims.make_product(study, options)
    check_thresholds(options)
    study = study.select_finished(
        *own_claims.READS, read_champion_swings, read_diversity, claims_runs.read_gains
    )
    pooled = _report_pooled(study)
    return own_claims.tabulate_findings(judge_claims(study, options), study, options, pooled)


def judge_claims(study: Study, options: argparse.Namespace) -> Iterator[Finding]:
    """Judge all claims by the finished runs of a study."""
    mirrored = study.keep(record for record in study.records if record.context.mirrored)
    free = study.keep(record for record in study.records if not record.context.mirrored)
    designs, free_designs = _describe(mirrored, options), _describe(free, options)
    yield claims_designs.judge_configurations(designs)
    yield claims_designs.judge_redundancy(designs)
    for ring in study.rings or paper_rings():
        yield claims_designs.judge_damage_clusters(designs, ring.radius_m)
    gains = _gather(mirrored, claims_runs.read_gains)
    for line in claims_runs.GAIN:
        yield claims_runs.judge_gain(gains, line)
    yield claims_runs.judge_approach(gains)
    yield from _judge_swings(mirrored)
    yield from claims_runs.judge_completion(list_missions(study), list_random_missions(study))
    kinds = set(map(classify_failure, free.records))
    comparable = mirrored.keep(r for r in mirrored.records if classify_failure(r) in kinds)
    yield claims_designs.judge_spread_between(designs[designs.kind.isin(kinds)], free_designs)
    diversity = (_gather(part, read_diversity) for part in (comparable, free))
    yield claims_designs.judge_spread_within(*diversity)


def _judge_swings(mirrored: Study) -> Iterator[Finding]:
    """Judge the swing of runs whose controller does not weave by itself apart from the others."""
    weaving = mirrored.keep(record for record in mirrored.records if _weaves(record))
    others = mirrored.keep(record for record in mirrored.records if not _weaves(record))
    if others.records or not weaving.records:
        yield claims_runs.judge_heading_swing(_gather(others, read_champion_swings))
    if weaving.records:
        yield claims_runs.judge_heading_swing(_gather(weaving, read_champion_swings), built_in=True)


def _weaves(record: Record) -> bool:
    return str(record.values.get("controller.navigation._target_", "")).endswith(WEAVING)


def _gather(study: Study, read: Callable[[Record], pd.DataFrame]) -> pd.DataFrame:
    """Gather the tables of all runs; the table is empty if no run has rows."""
    if any(len(read(record)) for record in study.records):
        return study.gather(read)
    return pd.DataFrame(columns=["first", "last"])


def _describe(study: Study, options: argparse.Namespace) -> pd.DataFrame:
    """Describe champions and random designs, with the kind of their failure."""
    if not study.records:
        return _NO_DESIGNS
    champions, initial = study.gather(read_champion), study.gather(read_initial_sensors)
    near = options.near_m, options.near_deg
    table = describe_designs(champions, initial, study.rings, *near)
    kinds = {record.name: classify_failure(record) for record in study.records}
    return table.assign(kind=table.run.map(kinds))


def _report_pooled(study: Study) -> Iterator[str]:
    """Report each kind of failure whose runs are of several treatments."""
    mirrored = [record for record in study.records if record.context.mirrored]
    for kind in dict.fromkeys(map(classify_failure, mirrored)):
        labels = dict.fromkeys(r.treatment for r in mirrored if classify_failure(r) == kind)
        if len(labels) > 1:
            yield f"failure {kind}: runs of several treatments are pooled: {'; '.join(labels)}"

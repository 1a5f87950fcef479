"""Summaries of runs and evaluations for reports, as tables and sentences."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from evoros.base.errors import InputError, escape, single_line, write_count
from evoros.files.resources import expand_home
from evoros.storage.layout import CONTROLS
from evoros.terminal.log import LOGGER

from ..figures.controls import compare_controls, describe_controls, summarize_controls
from ..figures.options import score_runs
from ..statistics.comparison import compare_treatments, conclude, title_measure
from ..statistics.small_samples import median_interval
from ..tables.champions import BEST_SO_FAR
from ..tables.records import EvaluationRecord, Record, label_fitness
from ..tables.study import Study
from ..tables.treatments import describe_factor

HASH_LENGTH = 12  # number of characters shown of a hash
VALIDATED, RECORDED = "validated", "recorded"


def name_page(folders: Sequence[Path]) -> str:
    """Return the title of a page: the names of its folders."""
    return ", ".join(escape(expand_home(folder).resolve().name) for folder in folders)


def summarize(study: Study) -> str:
    """Return the numbers of runs, treatments and evaluations, and the range of dates."""
    parts = []
    if study.records:
        finished = sum(record.finished for record in study.records)
        parts.append(f"{write_count(len(study.records), 'run')}, {finished} finished")
        parts.append(write_count(len(study.treatments), "treatment"))
    if study.evaluations:
        parts.append(write_count(len(study.evaluations), "evaluation"))
    records: tuple[Record, ...] = (*study.records, *study.evaluations)
    days = sorted(str(record.run.manifest.get("created", ""))[:10] for record in records)
    parts.append(days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}")
    return " · ".join(parts)


def label_runs(records: Sequence[Record]) -> dict[str, str]:
    """Label runs by treatment and seed or, where these are not unique, by name."""
    short = [f"{record.treatment}, seed {record.seed}" for record in records]
    names = [record.name for record in records]
    distinct = len(records) > 1 and len(set(short)) == len(short)
    labels = zip(records, short if distinct else names, strict=True)
    return {r.name: label if r.finished else f"{label}, {BEST_SO_FAR}" for r, label in labels}


def tabulate_runs(records: Sequence[Record]) -> pd.DataFrame:
    """List each run with its progress, best fitness, missions and pace."""
    table = pd.DataFrame([_run_row(record) for record in records])
    place = 1 + list(table.columns).index("treatment") if len(table) else 0
    for factor in dict.fromkeys(name for record in records for name in record.levels):
        levels = [record.levels.get(factor, "") for record in records]
        table.insert(place, describe_factor(factor), levels, allow_duplicates=True)
        place += 1
    return table


def _run_row(record: Record) -> dict[str, Any]:
    status = record.run.status
    wall_s = status.get("session_wall_s") or 0.0
    return {
        "treatment": record.treatment,
        "seed": record.seed,
        "state": status.get("state", ""),
        "generations": status.get("generations_done"),
        "recorded": status.get("best_fitness"),
        "validated": status.get("best_validated_fitness"),
        "low": status.get("fitness_low"),
        "high": status.get("fitness_high"),
        "max. lead of a rival": status.get("rival_advantage"),
        "missions": status.get("missions"),
        "simulated [s]": _simulated_s(record),
        "pace [s/s]": status.get("session_simulated_s", 0.0) / wall_s if wall_s else None,
        "run": record.name,
    }


def _simulated_s(record: Record) -> float | None:
    try:
        return float(record.run.missions["time_s"].sum())
    except (InputError, LookupError, ValueError, TypeError) as error:
        LOGGER.warning("%s; the simulated time is left out", single_line(error))
        return None


def tabulate_evaluations(evaluations: Sequence[EvaluationRecord]) -> pd.DataFrame:
    """List one row per evaluation."""
    rows = [
        (r.name, r.treatment, r.seed, r.run.status.get("state", ""), r.run.status.get("missions"))
        for r in evaluations
    ]
    return pd.DataFrame(rows, columns=["evaluation", "treatment", "seed", "state", "missions"])


def tabulate_versions(study: Study) -> pd.DataFrame:
    """List versions and digests with the number of folders that share them."""
    manifests = [record.run.manifest for record in (*study.records, *study.evaluations)]
    counts = Counter(pair for manifest in manifests for pair in _versions(manifest))
    order = list(dict.fromkeys(name for name, _ in counts))
    rows = [(*pair, counts[pair]) for pair in sorted(counts, key=lambda pair: order.index(pair[0]))]
    return pd.DataFrame(rows, columns=["what", "version or hash", "folders"])


def _versions(manifest: dict[str, Any]) -> Iterator[tuple[str, str]]:
    changed = " and changed files" if manifest.get("dirty") else ""
    yield "evoros, commit", f"{manifest.get('commit') or 'unknown'}{changed}"
    for name, version in (manifest.get("packages") or {}).items():
        yield name, str(version or "not installed")
    for name in ("python", "platform", "processor"):
        yield name, str(manifest.get(name, ""))
    for name, digest in (manifest.get("sha256") or {}).items():
        if not name.startswith("configuration"):  # these digests depend on the seed
            yield f"sha256 of {name}", str(digest)[:HASH_LENGTH]


def list_findings(study: Study) -> tuple[list[str], str]:
    """Return findings on the runs, controls first, and the reason if there are none."""
    if not study.records:
        return ([], "There are no runs to compare. Add the folders of runs.")
    controls = list_controls(study)
    try:
        runs, measures = score_runs(study, None)
        measure = next(name for name in (VALIDATED, RECORDED) if name in measures)
        if runs[VALIDATED].isna().all():
            measure = RECORDED
        table = compare_treatments(runs, [measure])
        label = label_fitness(study.records)
        lines = [*_describe_treatments(runs, measure, label), *conclude(table, label)]
    except InputError as error:
        return controls, single_line(error)
    warnings = [f"WARNING: {r.name}: {r.not_run}" for r in study.records if r.not_run]
    lines += [*_describe_best(study, label), "brackets are 95 % intervals"]
    if measure == RECORDED:
        luck = "recorded scores use the draws on which a design was selected, so they include luck"
        lines.append(luck)
    return [*controls, *warnings, *lines], ""


def list_controls(study: Study) -> list[str]:
    """Compare the champions of each treatment with their controls; empty if no run has any."""
    if not any((record.path / CONTROLS).is_dir() for record in study.records):
        return []
    try:
        summary = summarize_controls(compare_controls(study))
    except InputError as error:
        return [single_line(error)]
    return describe_controls(summary, label_fitness(study.records))


def _describe_treatments(runs: pd.DataFrame, measure: str, label: str) -> Iterator[str]:
    by = runs.dropna(subset=measure).groupby("treatment", sort=False)[measure]
    for treatment in by.median().sort_values(ascending=False).index:
        values = by.get_group(treatment).to_numpy(float)
        median = f"{median_interval(values).write()} of {write_count(values.size, 'run')}"
        yield f"{treatment}: median {title_measure(measure, label)} {median}"


def _describe_best(study: Study, label: str) -> Iterator[str]:
    try:
        best = study.ranked[0]
    except InputError:
        return
    status = best.run.status
    value, low, high = (
        status.get(name) for name in ("best_validated_fitness", "fitness_low", "fitness_high")
    )
    scores = f"{title_measure(RECORDED, label)} {status['best_fitness']:.2f}"
    if value is not None:
        scores = f"{title_measure(VALIDATED, label)} {value:.2f}"
        scores += "" if low is None else f" [{low:.2f}, {high:.2f}]"
    yield f"the best design comes from {best.name} ({best.treatment}, seed {best.seed}): {scores}"
    advantage = status.get("rival_advantage")
    if advantage is not None:
        yield f"on the same draws, no other design is better by more than {advantage:.2g}"

"""What runs and evaluations came to, as the tables of a report."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.base.log import LOGGER

from ..tables.records import Record, Scored
from ..tables.study import Study

HASH = 12  # characters of a hash that are shown


def sentence(study: Study) -> str:
    """How many of what, and when they were made."""
    parts = []
    if study.records:
        done = sum(record.finished for record in study.records)
        parts.append(f"{_count(len(study.records), 'run')}, {done} finished")
        parts.append(_count(len(study.treatments), "treatment"))
    if study.evaluations:
        parts.append(_count(len(study.evaluations), "evaluation"))
    everything: tuple[Record, ...] = (*study.records, *study.evaluations)
    days = sorted(str(record.run.manifest.get("created", ""))[:10] for record in everything)
    parts.append(days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}")
    return " · ".join(parts)


def labels(records: Sequence[Record]) -> dict[str, str]:
    """A short text for each run, by its name: its treatment and seed, where no two share both."""
    short = [f"{record.treatment}, seed {record.seed}" for record in records]
    names = [record.name for record in records]
    distinct = len(records) > 1 and len(set(short)) == len(short)
    return dict(zip(names, short if distinct else names, strict=True))


def run_rows(records: Sequence[Record]) -> pd.DataFrame:
    """A row for each run: how far it is, its best fitness, its missions and its pace."""
    return pd.DataFrame([_run_row(record) for record in records])


def _run_row(record: Record) -> dict[str, Any]:
    status = record.run.status
    wall = status.get("session_wall_s") or 0.0
    return {
        "treatment": record.treatment,
        "seed": record.seed,
        "state": status.get("state", ""),
        "generations": status.get("generations_done"),
        "recorded": status.get("best_fitness"),
        "validated": status.get("best_validated_fitness"),
        "missions": status.get("missions"),
        "simulated [s]": _simulated_s(record),
        "pace [s/s]": status.get("session_simulated_s", 0.0) / wall if wall else None,
        "run": record.name,
    }


def _simulated_s(record: Record) -> float | None:
    """Of all its missions, of earlier sessions too."""
    try:
        return float(record.run.missions["time_s"].sum())
    except (InputError, LookupError, ValueError, TypeError) as error:
        LOGGER.warning("%s; its simulated time is left out", " ".join(str(error).split()))
        return None


def evaluation_rows(evaluations: Sequence[Scored]) -> pd.DataFrame:
    """A row for each evaluation."""
    return pd.DataFrame(
        [
            {
                "evaluation": record.name,
                "treatment": record.treatment,
                "seed": record.seed,
                "state": record.run.status.get("state", ""),
                "missions": record.run.status.get("missions"),
            }
            for record in evaluations
        ]
    )


def versions(study: Study) -> pd.DataFrame:
    """What the folders were made with: a row for each version or hash, with how many have it."""
    everything: tuple[Record, ...] = (*study.records, *study.evaluations)
    found: dict[tuple[str, str], int] = {}
    for record in everything:
        for pair in _made_with(record.run.manifest):
            found[pair] = found.get(pair, 0) + 1
    order = list(dict.fromkeys(name for name, _ in found))
    rows = [(name, value, n) for (name, value), n in found.items()]
    rows.sort(key=lambda row: order.index(row[0]))
    return pd.DataFrame(rows, columns=["what", "version or hash", "folders"])


def _made_with(manifest: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "evoros, commit", str(manifest.get("commit") or "no checkout")
    for name, version in (manifest.get("packages") or {}).items():
        yield name, str(version or "not installed")
    for name in ("python", "platform", "processor"):
        yield name, str(manifest.get(name, ""))
    for name, digest in (manifest.get("sha256") or {}).items():
        if not name.startswith("configuration"):  # differs from run to run, by its seed
            yield f"sha256 of {name}", str(digest)[:HASH]


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"

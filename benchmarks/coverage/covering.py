"""Simulates how often each interval covers, and each test rejects, and writes the table."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from multiprocessing import get_context
from operator import itemgetter
from zlib import crc32

import numpy as np
from certificate_rows import CERTIFICATES
from interval_rows import INTERVALS
from level_rows import TESTS
from mission_rows import MISSIONS
from rows import Row, Subject
from stated import list_drifts

SUBJECTS: Sequence[Subject] = (*INTERVALS, *TESTS, *MISSIONS, *CERTIFICATES)
TOLERANCE = 0.02
"""A share that misses the nominal one by more is bold, unless that may be luck."""
FEWEST = 20
"""Fewest results that make a share: some rows hardly ever have one."""
Counts = Mapping[str, tuple[int, int]]
"""The number of positive results, and of all, by column."""


def main() -> int:
    """Run the command ``python benchmarks/coverage``."""
    parser = argparse.ArgumentParser(prog="coverage", description=__doc__)
    parser.add_argument("rows", nargs="*", help="words in the names of the rows; default: all")
    parser.add_argument("--repetitions", type=int, metavar="N", help="default: 100 to 3000")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument("--processes", type=int, default=2, metavar="N")
    options = parser.parse_args()
    chosen = [
        (index, place)
        for index, subject in enumerate(SUBJECTS)
        if not options.rows or any(word in subject.name for word in options.rows)
        for place in range(len(subject.rows))
    ]
    if not chosen:
        names = "; ".join(subject.name for subject in SUBJECTS)
        print(f"rows: must be words in one of the names ({names})", file=sys.stderr)
        return 2
    tasks = [(*row, options.repetitions, options.seed) for row in chosen]
    kept: list[Counts] = []
    with ProcessPoolExecutor(options.processes, get_context("fork")) as pool:
        counts = _keep(pool.map(_measure, tasks), kept)
        for line in write_tables((*row, of) for row, of in zip(chosen, counts, strict=True)):
            print(line, flush=True)
    drifts = list(find_drifts((*row, of) for row, of in zip(chosen, kept, strict=True)))
    for drift in drifts:
        print(drift, file=sys.stderr)
    return int(bool(drifts))


def _keep(items: Iterable[Counts], kept: list[Counts]) -> Iterator[Counts]:
    for item in items:
        kept.append(item)
        yield item


def find_drifts(measured: Iterable[tuple[int, int, Counts]]) -> Iterator[str]:
    """Yield what commands print otherwise than measured, by more than luck."""
    for index, rows in groupby(measured, itemgetter(0)):
        cells = [
            (column, 100 * positive / known, known)
            for *_, counts in rows
            for column, (positive, known) in counts.items()
            if known >= FEWEST
        ]
        fewest = min((known for *_, known in cells), default=1)
        tolerance = 1 + 3 * 100 * (0.25 / fewest) ** 0.5
        yield from list_drifts(SUBJECTS[index], [cell[:2] for cell in cells], tolerance)


def _measure(task: tuple[int, int, int | None, int]) -> Counts:
    index, place, repetitions, seed = task
    subject = SUBJECTS[index]
    return measure(subject, subject.rows[place], repetitions or subject.repetitions, seed)


def measure(subject: Subject, row: Row, repetitions: int, seed: int) -> Counts:
    """Repeat the trials of a row; those without a result do not count."""
    counts = {}
    for column, trial in row.trials.items():
        key = crc32(f"{subject.name}/{row.data}/{column}".encode())
        rng = np.random.default_rng([seed, key])
        results = [result for _ in range(repetitions) if (result := trial(rng)) is not None]
        counts[column] = sum(results), len(results)
    return counts


def write_tables(measured: Iterable[tuple[int, int, Counts]]) -> Iterator[str]:
    """Yield a Markdown table for each set of columns."""
    for columns, rows in groupby(measured, lambda row: SUBJECTS[row[0]].columns):
        yield ""
        yield f"| what | printed by | should be | data | {' | '.join(columns)} |"
        yield "|---" * (4 + len(columns)) + "|"
        for index, places in groupby(rows, itemgetter(0)):
            subject = SUBJECTS[index]
            goal = "95 or more" if subject.is_interval else "5 or less"
            head = f"{subject.name} | {subject.printed_by} | {goal}"
            for _, place, counts in places:
                cells = [_write(subject, *counts.get(column, (0, 0))) for column in columns]
                yield f"| {head} | {subject.rows[place].data} | {' | '.join(cells)} |"
                head = " | | "


def _write(subject: Subject, positive: int, known: int) -> str:
    if known < FEWEST:
        return ""
    share = positive / known
    missed = subject.nominal - share if subject.is_interval else share - subject.nominal
    luck = 2 * (subject.nominal * (1 - subject.nominal) / known) ** 0.5
    return f"**{100 * share:.0f}**" if missed > max(TOLERANCE, luck) else f"{100 * share:.0f}"

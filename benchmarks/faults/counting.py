"""Injects faults into evoros and counts how the cases end.

    python benchmarks/faults KIND [--count N] [--first SEED] [--table FILE]
    python benchmarks/faults KIND --case SEED

Prints how many cases of each sort ended how, and each fault with its seed; ``--table`` writes a
row for each case. The exit status is 1 if there is a fault. docs/development.md says what counts
as whole.
"""

import argparse
import csv
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from typing import TextIO

from cases import FAULT, run_cases
from pure_calls import share_pure_calls

COUNTS = {
    "power_cuts": 1000,
    "kills": 500,
    "damages": 1000,
    "fuzz": 10_000,
    "hostile": 1000,
    "soak": 300_000,
}
"""The module of each kind, and the cases of a long run."""
FIELDS = ("kind", "seed", "case", "verdict", "about")


def main(arguments: Sequence[str]) -> int:
    """Try the chosen cases."""
    parser = argparse.ArgumentParser("python benchmarks/faults", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("kind", choices=COUNTS)
    parser.add_argument("--count", type=int, metavar="N", help=f"cases; {COUNTS}")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="of the first case")
    parser.add_argument("--case", type=int, metavar="SEED", help="try this case alone")
    parser.add_argument("--table", type=Path, metavar="FILE", help="a CSV row for each case")
    options = parser.parse_args(arguments)
    if options.kind == "soak":
        return int(import_module("soak").soak(options.count or COUNTS["soak"]))
    first, count = options.first, options.count or COUNTS[options.kind]
    seeds = range(first, first + count) if options.case is None else [options.case]
    with ExitStack() as stack:
        table = stack.enter_context(options.table.open("w")) if options.table else None
        return try_all(options.kind, seeds, table)


def try_all(name: str, seeds: Sequence[int], table: TextIO | None) -> int:
    """Try cases, print the counts and return the exit status."""
    module, begun = import_module(name), time.monotonic()
    counts: Counter[tuple[str, str]] = Counter()
    rows = csv.writer(table, lineterminator="\n") if table else None
    if rows:
        rows.writerow(FIELDS)
    with share_pure_calls(), suppress(KeyboardInterrupt):  # Ctrl-C: what was counted
        for seed, result in run_cases(module.prepare, seeds, module.LIMIT_S):
            counts[result.case.partition(":")[0], result.verdict] += 1
            if rows and table:
                rows.writerow((name, seed, *result))
                table.flush()
            if result.verdict == FAULT or len(seeds) == 1:
                print(f"{name} {seed}: {result.case}: {result.verdict} {result.about}", flush=True)
    for (case, verdict), count in sorted(counts.items()):
        print(f"{count:6} {case}: {verdict}")
    print(f"{sum(counts.values()):6} cases in {time.monotonic() - begun:.0f} s")
    return int(any(verdict == FAULT for _, verdict in counts))

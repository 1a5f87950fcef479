"""Measures which random mutants of core rules the tests of their room kill.

Cosmic Ray finds and makes the mutants; each runs the quick tests of its room in a clone:

    pip install cosmic-ray
    python benchmarks/mutations/mutants.py [--mutants 300] [--seed 0] [--rooms mission design ...]
    python benchmarks/mutations/mutants.py --again    # only those that survived, in changed code

A place in the code is drawn first and then one of its mutations, so that an operator with many
mutations does not count more. Rooms get mutants in proportion to their places. Results go to
outputs/mutations/results.csv; mutants that are already there do not run again. The sample depends
on the code; ``--again`` therefore finds the survivors in changed code by the text of their change.
"""

import argparse
import ast
import csv
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).parents[2]
ROOMS = ["mission", "design", "optimizer", "evolution", "dispatch", "failure", "filter", "fitness"]
ROOMS += ["requirement", "certificate"]
FOLDER = ROOT / "outputs" / "mutations"
COLUMNS = ("room", "module", "line", "operator", "occurrence", "outcome", "seconds", "change")
KILLED, SURVIVED, ENDLESS, GONE = "killed", "survived", "killed (time limit)", "code deleted"


class Mutant(NamedTuple):
    """One mutation: the ``occurrence`` of an operator in a module."""

    room: str
    module: str  # relative to the checkout
    line: int
    operator: str
    occurrence: int


Place = tuple[int, int, int, int]  # first line and column, last line and column


def list_annotations(source: str) -> list[Place]:
    """Return the places of type annotations, where a mutant is no fault of a rule."""
    found: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.arg | ast.AnnAssign):
            found.append(node.annotation)
        elif isinstance(node, ast.FunctionDef):
            found.append(node.returns)
    return [
        (node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0)
        for node in found
        if node
    ]


def list_mutants(room: str, module: Path) -> dict[Place, list[Mutant]]:
    """Return the mutants of a module by their place in the code."""
    source = module.read_text()
    annotations = list_annotations(source)
    nodes, places = list(ast_nodes(get_ast(source))), dict[Place, list[Mutant]]()
    for name in operator_names():
        operator = get_operator(name)
        if operator.arguments():  # needs to be told what to change
            continue
        positions = (p for node in nodes for p in operator().mutation_positions(node))
        for occurrence, (start, end) in enumerate(positions):
            if any(a[:2] <= start and end <= a[2:] for a in annotations):
                continue
            mutant = Mutant(room, str(module.relative_to(ROOT)), start[0], name, occurrence)
            places.setdefault((*start, *end), []).append(mutant)
    return places


def draw_mutants(rooms: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Draw mutants at different places of the rooms."""
    places = [
        mutants
        for room in rooms
        for module in sorted((ROOT / "evoros" / room).rglob("*.py"))
        for mutants in list_mutants(room, module).values()
    ]
    rng = np.random.default_rng(seed)
    drawn = rng.permutation(len(places))[:count]
    return [places[i][rng.integers(len(places[i]))] for i in drawn]


def mutate(source: str, mutant: Mutant) -> str:
    """Return the source of the mutant's module with the mutation."""
    changed: str = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
    return changed


def describe(source: str, changed: str) -> str:
    """Return the first line that a mutation changes, before and after."""
    lines = zip(source.splitlines(), changed.splitlines(), strict=False)
    return next((f"{a.strip()} -> {b.strip()}" for a, b in lines if a != b), "")


def find_again(row: Mapping[str, str]) -> Mutant | None:
    """Return the mutant of an earlier result in the present code, the nearest of equal ones."""
    path = ROOT / row["module"]
    if not path.exists():
        return None
    source = path.read_text()
    mutants = [one for place in list_mutants(row["room"], path).values() for one in place]
    alike = [
        one
        for one in mutants
        if one.operator == row["operator"]
        and describe(source, mutate(source, one)) == row["change"]
    ]
    return min(alike, key=lambda one: abs(one.line - int(row["line"])), default=None)


def run_tests(clone: Path, room: str, limit_s: float | None) -> str:
    """Run the quick tests of a room up to the first failure, and return the outcome."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", f"tests/{room}"]
    environment = {**os.environ, "PYTHONPATH": str(clone)}
    try:
        done = subprocess.run(
            command, cwd=clone, env=environment, capture_output=True, timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return ENDLESS
    return KILLED if done.returncode else SURVIVED


def run_mutants(clone: Path, mutants: Sequence[Mutant]) -> Iterator[dict[str, object]]:
    """Yield a row of results for each mutant; the tests of the room must pass without it."""
    limits: dict[str, float] = {}
    for mutant in mutants:
        if mutant.room not in limits:
            begun = time.monotonic()
            if run_tests(clone, mutant.room, None) != SURVIVED:
                sys.exit(f"tests/{mutant.room}: fail without a mutant; mend them first")
            limits[mutant.room] = 60.0 + 4.0 * (time.monotonic() - begun)
        path, begun = clone / mutant.module, time.monotonic()
        source = path.read_text()
        changed = mutate(source, mutant)
        path.write_text(changed)
        try:
            outcome = run_tests(clone, mutant.room, limits[mutant.room])
        finally:
            path.write_text(source)
        seconds = round(time.monotonic() - begun, 1)
        change = describe(source, changed)
        yield {**mutant._asdict(), "outcome": outcome, "seconds": seconds, "change": change}


def run_new(clone: Path, drawn: Sequence[Mutant], results: Path) -> None:
    """Run the drawn mutants that the results lack."""
    rows = read(results) if results.exists() else []
    known = {tuple(row[name] for name in Mutant._fields) for row in rows}
    with results.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if not rows:
            writer.writeheader()
        new = [mutant for mutant in drawn if tuple(map(str, mutant)) not in known]
        for row in run_mutants(clone, sorted(new)):
            writer.writerow(row)
            file.flush()
            print(*row.values(), sep="\t", flush=True)


def run_again(clone: Path, results: Path) -> None:
    """Run the survivors again in the present code, and write their new outcomes."""
    rows = read(results)
    for row in rows:
        if row["outcome"] == SURVIVED:
            mutant = find_again(row)
            new = next(run_mutants(clone, [mutant])) if mutant else {"outcome": GONE}
            row["outcome"] = str(new["outcome"])
            print(*row.values(), sep="\t", flush=True)
    with results.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def read(results: Path) -> list[dict[str, str]]:
    with results.open(newline="") as file:
        return list(csv.DictReader(file))


def main(rooms: Sequence[str], count: int, seed: int, results: Path, again: bool) -> None:
    """Run mutants, and print the share of killed ones."""
    results.parent.mkdir(parents=True, exist_ok=True)
    clone = results.parent / f"clone_{os.getpid()}"
    subprocess.run(["git", "clone", "-q", ROOT, clone], check=True)
    if again:
        run_again(clone, results)
    else:
        run_new(clone, draw_mutants(rooms, count, seed), results)
    for room in (*rooms, None):
        outcomes = [row["outcome"] for row in read(results) if room in (row["room"], None)]
        print(room or "all", len(outcomes), sum(one != SURVIVED for one in outcomes), sep="\t")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", default=ROOMS, choices=ROOMS)
    parser.add_argument("--mutants", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--results", type=Path, default=FOLDER / "results.csv")
    parser.add_argument("--again", action="store_true")
    given = parser.parse_args()
    main(given.rooms, given.mutants, given.seed, given.results, given.again)

"""The verdicts on the requirements of an evaluation, in its folder."""

import csv
from collections.abc import Mapping, Sequence

from evoros.requirement.pipeline import Row, write_junit, write_markdown
from evoros.requirement.requirements import Requirement
from evoros.requirement.verdict import UNDECIDED, VIOLATED, Verdict
from evoros.session.design_tables import NamedDesign
from evoros.storage.layout import REQUIREMENTS
from evoros.storage.tables import to_csv

JUNIT, SUMMARY = "junit.xml", "requirements.md"
COLUMNS = (
    *("source", "design", "requirement", "claim", "result", "value", "low", "high"),
    *("confidence", "trials", "worst_world", "worst_trial", "case"),
)


def write_verdicts(
    designs: Sequence[NamedDesign],
    claims: Mapping[str, Requirement],
    verdicts: Mapping[int, Mapping[str, Verdict]],
) -> dict[str, str]:
    """Return the files with the verdicts on each requirement of each design, by their names."""
    rows: list[Sequence[object]] = [COLUMNS]
    for index, design in enumerate(designs):
        for name, claim in claims.items():
            verdict = verdicts[index][name]
            trial, world = verdict.worst
            key = (design.source, design.name, name, claim.text, verdict.result)
            numbers = (verdict.value, verdict.low, verdict.high, verdict.confidence, verdict.trials)
            rows.append([*key, *numbers, world, trial, verdict.case])
    table = to_csv(rows)
    read = list(csv.DictReader(table.splitlines()))
    return {REQUIREMENTS: table, JUNIT: write_junit(read).decode(), SUMMARY: write_markdown(read)}


def find_worst(rows: Sequence[Row]) -> str:
    """Return the worst of the results, empty without any: VIOLATED, UNDECIDED or MET."""
    results = [row["result"] for row in rows]
    for result in (VIOLATED, UNDECIDED):
        if result in results:
            return result
    return results[0] if results else ""

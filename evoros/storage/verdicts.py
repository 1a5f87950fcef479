"""The verdicts on an evaluation's requirements, as CSV, JUnit XML and Markdown."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from evoros.requirement.requirements import Judged, Requirement
from evoros.requirement.verdict import MET, Verdict
from evoros.storage.layout import JUNIT, REQUIREMENTS, SUMMARY, read_rows
from evoros.storage.tables import to_csv

Row = Mapping[str, str]  # row of ``requirements.csv``
COLUMNS = (
    *("source", "design", "requirement", "level", "claim", "result", "value", "low", "high"),
    *("confidence", "limit", "unit", "trials", "further_trials", "decided_by"),
    *("worst_world", "worst_trial"),
)


def write_verdicts(
    requirements: Mapping[str, Requirement], judged: Mapping[tuple[str, str], Mapping[str, Judged]]
) -> dict[str, str]:
    """Return the contents of the files of verdicts, by file name."""
    rows: list[Sequence[object]] = [COLUMNS]
    for design, verdicts in judged.items():
        for name, requirement in requirements.items():
            whole = {"": verdicts[name].whole}
            for level, verdict in {**whole, **verdicts[name].levels}.items():
                rows.append([*design, name, level, requirement.text, *_list_numbers(verdict)])
    table = to_csv(rows)
    read = list(csv.DictReader(table.splitlines()))
    return {REQUIREMENTS: table, JUNIT: write_junit(read).decode(), SUMMARY: write_markdown(read)}


def _list_numbers(verdict: Verdict) -> list[object]:
    trial, world = verdict.worst
    bounds = (verdict.value, verdict.low, verdict.high, verdict.confidence)
    trials = (verdict.trials, verdict.further, verdict.decided_by)
    limit = (verdict.limit, verdict.unit)
    return [verdict.result, *bounds, *limit, *trials, world, trial]


def write_junit(rows: Sequence[Row]) -> bytes:
    """Return the verdicts as JUnit XML with a suite per design; all except MET are failures."""
    # Jenkins's junit-10.xsd and other consumers disagree on the elements for errors.
    root = ElementTree.Element("testsuites", _count(rows))
    for design in dict.fromkeys(_name_design(row) for row in rows):
        of_design = [row for row in rows if _name_design(row) == design]
        suite = ElementTree.SubElement(root, "testsuite", {"name": design, **_count(of_design)})
        for row in of_design:
            names = {"classname": design, "name": name_requirement(row)}
            case = ElementTree.SubElement(suite, "testcase", names)
            if row["result"] != MET:
                about = {"type": row["result"], "message": describe(row)}
                told = ElementTree.SubElement(case, "failure", about)
                told.text = f"{row['result']}: {row['claim']}; {describe(row)}"
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return content + b"\n"


def _count(rows: Iterable[Row]) -> dict[str, str]:
    met = [row["result"] == MET for row in rows]
    return {"tests": str(len(met)), "failures": str(met.count(False)), "errors": "0"}


def write_markdown(rows: Sequence[Row]) -> str:
    """Return the verdicts as a Markdown table."""
    lines = ["| result | requirement | design | numbers |", "|---|---|---|---|"]
    for row in rows:
        cells = (f"**{row['result']}**", name_requirement(row), _name_design(row), describe(row))
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def describe(row: Row) -> str:
    """Describe the numbers that a verdict is based on."""
    bounds: dict[str, Any] = {
        key: float(row[key]) for key in ("value", "low", "high", "confidence", "limit")
    }
    return Verdict(
        result=row["result"],
        trials=int(row["trials"]),
        unit=row["unit"],
        worst=(int(row["worst_trial"]), row["worst_world"]),
        further=float(row["further_trials"]),
        decided_by=row["decided_by"],
        **bounds,
    ).text


def name_requirement(row: Row) -> str:
    """Return the name of a requirement, or of one of its levels, with the claim."""
    level = f" [{row['level']}]" if row["level"] else ""
    return f"{row['requirement']}{level}: {row['claim']}"


def _name_design(row: Row) -> str:
    return f"{row['design']} of {row['source']}"


def read_verdicts(folder: Path) -> Sequence[Row]:
    """Read the verdicts of a finished evaluation; empty if it has no requirements."""
    path = folder / REQUIREMENTS
    return read_rows(path) if path.is_file() else []


def name_worst(row: Row) -> dict[str, str]:
    """Return the columns that identify the worst mission for ``evoros replay``."""
    place = {"world": row["worst_world"], "trial": row["worst_trial"]}
    return {"source": row["source"], "design": row["design"], **place}

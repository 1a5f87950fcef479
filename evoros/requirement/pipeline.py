"""Verdicts in the formats that pipelines read: JUnit XML, and a summary in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree

from evoros.requirement.verdict import MET, Verdict

Row = Mapping[str, str]
"""A row of ``requirements.csv``."""


def write_junit(rows: Sequence[Row]) -> bytes:
    """Return the verdicts as JUnit XML, a test suite for each design.

    What is not met is a failure whose type is its result: the schema of Jenkins's xUnit plugin
    (junit-10.xsd) and other consumers name the element for errors differently.
    """
    root = ElementTree.Element("testsuites", _count(rows))
    for design in dict.fromkeys(_name_design(row) for row in rows):
        of_design = [row for row in rows if _name_design(row) == design]
        suite = ElementTree.SubElement(root, "testsuite", {"name": design, **_count(of_design)})
        for row in of_design:
            names = {"classname": design, "name": f"{row['requirement']}: {row['claim']}"}
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
    """Return the verdicts as a table in Markdown."""
    lines = ["| result | requirement | design | numbers |", "|---|---|---|---|"]
    for row in rows:
        text = f"{row['requirement']}: {row['claim']}"
        cells = (f"**{row['result']}**", text, _name_design(row), describe(row))
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def describe(row: Row) -> str:
    """Describe the numbers behind a verdict."""
    value, low, high, confidence = (
        float(row[name]) for name in ("value", "low", "high", "confidence")
    )
    worst = int(row["worst_trial"]), row["worst_world"]
    counted = row["result"], int(row["trials"])
    return Verdict(*counted, value, low, high, confidence, worst, row["case"]).text


def _name_design(row: Row) -> str:
    return f"{row['design']} of {row['source']}"

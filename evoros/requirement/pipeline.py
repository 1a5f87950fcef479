"""Verdicts in the formats that pipelines read: JUnit XML, and a summary in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree

from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED

Row = Mapping[str, str]
"""A row of ``requirements.csv``."""
TAGS = {VIOLATED: "failure", UNDECIDED: "error"}
"""The element in which JUnit tells of a requirement that is not met."""


def write_junit(rows: Sequence[Row]) -> bytes:
    """Return the verdicts as JUnit XML, a test suite for each design.

    The elements and attributes are those of the schema of Jenkins's xUnit plugin (junit-10.xsd).
    """
    root = ElementTree.Element("testsuites", _count(rows))
    for design in dict.fromkeys(_name_design(row) for row in rows):
        of_design = [row for row in rows if _name_design(row) == design]
        suite = ElementTree.SubElement(root, "testsuite", {"name": design, **_count(of_design)})
        for row in of_design:
            names = {"classname": design, "name": f"{row['requirement']}: {row['claim']}"}
            case = ElementTree.SubElement(suite, "testcase", names)
            if row["result"] in TAGS:
                about = {"type": row["result"], "message": describe(row)}
                told = ElementTree.SubElement(case, TAGS[row["result"]], about)
                told.text = f"{row['claim']}: {describe(row)}"
    ElementTree.indent(root)
    content: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return content + b"\n"


def _count(rows: Iterable[Row]) -> dict[str, str]:
    results = [row["result"] for row in rows]
    counts = {"failures": VIOLATED, "errors": UNDECIDED}
    numbers = {name: str(results.count(result)) for name, result in counts.items()}
    return {"tests": str(len(results)), **numbers}


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
    value, low, high = (float(row[name]) for name in ("value", "low", "high"))
    text = (
        f"{value:.4g} by {row['trials']} trials, at least {low:.4g} and at most {high:.4g}, each "
        f"with confidence {float(row['confidence']):g}"
    )
    if row["result"] == MET:
        return text
    failed = f" with the failures {row['case']}" if row["case"] else ""
    place = f"trial {row['worst_trial']} in {row['worst_world']}"
    return f"{text}; the worst mission is {place}{failed}"


def _name_design(row: Row) -> str:
    return f"{row['design']} of {row['source']}"

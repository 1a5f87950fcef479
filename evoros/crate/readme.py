"""The README of an archive."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evoros.crate.metadata import StudyFacts
from evoros.storage.archives import RUNS

_LAYOUT = """| place | content |
|---|---|
| `runs/` | the runs and evaluations, as folders of evoros (docs/run_folder.md of evoros) |
| `inputs/` | the files from which they follow: own parts, robots, worlds, meshes |
| `software/requirements.txt` | the packages, in the versions of the runs |
| `software/packages.csv` | these, with the SHA-256 of what was installed |
| `software/evoros.patch` | how evoros differed from its commit, if it did |
| `ro-crate-metadata.json` | what is what, as an RO-Crate |
| `checksums.sha256` | SHA-256 of all other files, for `sha256sum --check checksums.sha256` |
"""


@dataclass(frozen=True)
class Code:
    """The code of evoros that made an archive's runs."""

    commits: Sequence[str]  # of the runs, each once
    changed: bool  # whether files differed from the commit in a run
    has_patch: bool


def write_readme(facts: StudyFacts, code: Code, archive: str, own_parts: str | None) -> bytes:
    """Return the text of a file ``README.md`` for an archive of this name."""
    rows = [
        f"| `{_name(run.place)}` | {_describe(run.manifest, run.status)} |" for run in facts.runs
    ]
    parts = (
        f"\nReproducing runs the code in `{own_parts}/`. Nothing else does.\n" if own_parts else ""
    )
    lines = [
        f"# {facts.name}\n\nA study by evoros {facts.version}, archived with all that is needed to "
        f"run it again.\n\n{_LAYOUT}\n## Runs\n\n| name | what it is |\n|---|---|\n",
        "\n".join(rows),
        f"\n\n## Code\n\n{_describe_code(code)}\n\n## Run it again\n\n",
        "```bash\npython -m venv again\n"
        f"again/bin/pip install evoros=={facts.version}  # or evoros from its commit\n"
        "again/bin/pip install -r software/requirements.txt  # unzipped; the same versions\n"
        f"again/bin/evoros reproduce {archive} --output reproduced\n```\n\n"
        "The last command compares every byte, and names the first difference. "
        f'`evoros.load_run("{archive}")`, `evoros analyze`, `evoros status` and `evoros diff` read '
        f"the archive as it is and run nothing in it.\n{parts}\n## Licence and citation\n\n",
        f"{_describe_rights(facts)} evoros itself has the licence in `software/LICENSE`; cite it, "
        f"with its version, as `software/CITATION.cff` says.\n",
    ]
    return "".join(lines).encode()


def _name(place: str) -> str:
    return place.removeprefix(f"{RUNS}/")


def _describe(manifest: Mapping[str, Any], status: Mapping[str, Any]) -> str:
    best = status.get("best_fitness")
    fitness = "" if best is None else f", best fitness {best:.6g}"
    missions = status.get("missions")
    return f"{manifest['command']}, seed {manifest['seed']}, {missions} missions{fitness}"


def _describe_code(code: Code) -> str:
    commits = ", ".join(f"`{commit}`" for commit in code.commits) or "unknown"
    text = f"Commit of evoros: {commits}."
    if code.has_patch:
        return f"{text} Files differed from it as `software/evoros.patch` says."
    if code.changed:
        return f"{text} Files differed from it, and nobody knows how."
    return text


def _describe_rights(facts: StudyFacts) -> str:
    licence = facts.licence or "none was chosen"
    authors = ", ".join(facts.authors)
    named = f" Authors: {authors}." if authors else ""
    return f"Licence of this study: {licence}.{named}"

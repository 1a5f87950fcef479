"""One page of a study that opens in any browser, without a network: ``report.html``."""

import argparse
import base64
import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib import resources

from ..product import Product
from ..subcommands import SUBCOMMANDS
from ..tables.records import Record
from ..tables.study import Study
from .html import folded, listing, paragraph, table
from .outline import differences_of, outline
from .playback import playbacks
from .section import chapter, left_out
from .summary import evaluation_rows, labels, run_rows, sentence, versions

HELP = "one HTML page with everything, and the champions' missions to be played"
FORMATS = ("html",)
FIGURES = tuple(name for name in SUBCOMMANDS if name not in ("report", "replay"))
"""What is asked for its figure, table and conclusions, each in its own section or under Figures."""
OWN_SECTION = {"compare": "Statistics", "claims": "Claims"}
SCRIPTS = ("missions.js", "plan.js", "readings.js", "player.js", "tables.js")
_SLOT = re.compile(r"\{\{(\w+)\}\}")


def arguments(parser: argparse.ArgumentParser) -> None:
    """How many missions can be played."""
    parser.add_argument(
        "--replays",
        type=float,
        default=3.0,
        metavar="MB",
        help="size of the missions in the page: the best run of each treatment, which is always "
        "there, then the others, as far as they fit; 3",
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """The page of a study."""
    replays = playbacks(study, options.replays * 1e6)
    sections = dict(_sections(study, options, replays))
    named = labels(study.records)
    script = "\n" + "".join(map(_asset, SCRIPTS))
    page = _filled(
        _asset("page.html"),
        policy=_policy(script),
        title=escape(_title(study, options)),
        subtitle=escape(sentence(study)),
        style=_asset("style.css"),
        contents="".join(f'<li><a href="#{_anchor(name)}">{name}</a></li>' for name in sections),
        sections="\n".join(
            f'<section id="{_anchor(name)}">\n<h2>{name}</h2>\n{content}\n</section>'
            for name, content in sections.items()
        ),
        data="\n".join(
            f'<script type="application/json" data-label="{escape(named[name])}">{content}</script>'
            for name, content in replays.items()
        ),
        script=script,
    ).encode()
    played = f"missions of {len(replays)} of {len(study.records)} runs"
    said = f"report.html: {len(page) / 1e6:.1f} MB, with the {played} to be played"
    return Product(said=[said], files={"report.html": page})


def _sections(
    study: Study, options: argparse.Namespace, replays: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    yield "Summary", _summary(study)
    yield "Configuration", _configuration(study)
    yield "Replay", _player(study, replays)
    drawn = {name: chapter(name, study, options, name in OWN_SECTION) for name in FIGURES}
    yield "Figures", "\n".join(drawn[name] for name in FIGURES if name not in OWN_SECTION)
    for name, title in OWN_SECTION.items():
        yield title, drawn[name]
    yield "Made with", table(versions(study))


def _title(study: Study, options: argparse.Namespace) -> str:
    return ", ".join(path.expanduser().resolve().name for path in options.folders)


def _summary(study: Study) -> str:
    parts = []
    if study.records:
        words = (
            "Recorded is the fitness on the draws that selected the design, validated that on "
            "fresh ones, the few of the run itself; evaluations that validate are below. Pace is "
            "simulated time over wall-clock time."
        )
        parts += [table(run_rows(study.records)), paragraph(words, "quiet")]
    if study.evaluations:
        parts += ["<h3>Evaluations</h3>", table(evaluation_rows(study.evaluations))]
    parts.append(left_out(study.left_out))
    return "\n".join(parts)


def _configuration(study: Study) -> str:
    """Runs and evaluations apart: a treatment of one is not that of the other."""
    groups: dict[str, Sequence[Record]] = {"Runs": study.records, "Evaluations": study.evaluations}
    there = {name: records for name, records in groups.items() if records}
    parts = []
    for name, records in there.items():
        parts += [f"<h3>{name}</h3>"] * (len(there) > 1)
        parts.append(_configured(records))
    return "\n".join(parts)


def _configured(records: Sequence[Record]) -> str:
    first = {record.treatment: record for record in reversed(records)}
    differing = differences_of(records)
    varied = {*differing["key"], *(["seed"] if len(records) > 1 else [])}
    common = {key: value for key, value in records[0].values.items() if key not in varied}
    parts = []
    if len(differing):
        parts += [paragraph("What differs between treatments:"), table(differing)]
        parts.append(paragraph("What they have in common:"))
    parts.append(listing(outline(common)))
    for treatment in dict.fromkeys(record.treatment for record in records):
        record = first[treatment]
        text = (record.path / "config.yaml").read_text(errors="replace")
        parts.append(folded(f"config.yaml of {record.name}", f"<pre>{escape(text)}</pre>"))
    return "\n".join(parts)


def _player(study: Study, replays: Mapping[str, str]) -> str:
    if not replays:
        return paragraph(
            "No finished run has a champion whose missions could be played.", "missing"
        )
    more = sum(record.finished for record in study.records) - len(replays)
    rest = f" The other {more} runs are left out, for size; see --replays." if more else ""
    words = (
        "The champion's first mission in each world, from above. Each cone ends at the sensor's "
        "reading, in one colour for mirrored twins; faint: nothing in sight; grey and crossed: "
        "failed. The path is coloured by what decided. Keys: space plays, arrows move by 1 s "
        f"(with shift 10 s), Home and End, + and - zoom.{rest}"
    )
    return f"{paragraph(words)}\n{_asset('player.html')}"


def _policy(script: str) -> str:
    """Nothing is fetched, and no script runs but this one."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath("web", name).read_text()


def _filled(template: str, **slots: str) -> str:
    """The template with its slots filled; what fills them is not looked into."""
    return _SLOT.sub(lambda found: slots[found[1]], template)


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")

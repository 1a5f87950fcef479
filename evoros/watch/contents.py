"""What the server gives: the page, its parts, and the digests by which the page knows changes."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from evoros.analysis.report.frame import (
    MISSIONS,
    Page,
    assemble,
    name_section,
    read_scripts,
    render_parts,
    render_section,
    write_policy,
)
from evoros.analysis.report.page import SCRIPTS

SCRIPT = read_scripts([*SCRIPTS, "live"])
POLICY = write_policy(SCRIPT, "'self'")
HTML, JSON = "text/html; charset=utf-8", "application/json"


@dataclass(frozen=True)
class Content:
    """The content of one address."""

    kind: str
    data: bytes
    digest: str


@dataclass(frozen=True)
class Contents:
    """The contents of all addresses; what a look does not change is rendered once."""

    title: str
    parts: Mapping[str, Content]
    state: Content

    def find(self, address: str) -> Content | None:
        """Find a content: ``""`` is the page, ``part/ID`` one of its parts."""
        if not address:
            return self._assemble()
        kind, _, key = address.partition("/")
        return self.parts.get(key) if kind == "part" else {"state": self.state}.get(address)

    def _assemble(self) -> Content:
        parts = {key: Markup(part.data.decode()) for key, part in self.parts.items()}
        known = Markup('{}\n<script type="application/json" data-state>{}</script>')
        looked = Markup(self.state.data.decode().replace("<", "\\u003c"))
        parts[MISSIONS] = known.format(parts[MISSIONS], looked)
        return _make(HTML, assemble(self.title, parts, SCRIPT, POLICY, ("style", "live")))


def draw_parts(page: Page) -> dict[str, Content]:
    """Render the parts of a page, by their ids."""
    return {key: _make(HTML, part) for key, part in render_parts(page).items()}


def make_contents(
    title: str,
    drawn: Mapping[str, Content],
    progress: tuple[str, Markup],
    state: Mapping[str, object],
) -> Contents:
    """Return the contents of a page with one section, ``progress``, renewed.

    ``state`` is what the page tells besides the parts.
    """
    parts = {**drawn, name_section(progress[0]): _make(HTML, render_section(*progress))}
    digests = [(key, part.digest) for key, part in parts.items()]
    return Contents(title, parts, _make(JSON, json.dumps({**state, "parts": digests})))


def _make(kind: str, text: str) -> Content:
    data = text.encode()
    return Content(kind, data, hashlib.sha256(data).hexdigest()[:16])

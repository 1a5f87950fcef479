"""What the server gives: the page, its parts, and the digests by which the page knows changes."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from evoros.analysis.report.frame import Page, assemble, read_scripts, render_parts, write_policy
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


def make_contents(page: Page, state: Mapping[str, object]) -> dict[str, Content]:
    """Return the contents by their addresses: the page is ``""``, its parts ``part/ID``.

    ``state`` is what the page tells besides the parts.
    """
    parts = render_parts(page)
    contents = {f"part/{key}": _make(HTML, part) for key, part in parts.items()}
    digests = {key: contents[f"part/{key}"].digest for key in parts}
    looked = json.dumps({**state, "parts": list(digests.items())})
    contents["state"] = _make(JSON, looked)
    known = Markup('{}\n<script type="application/json" data-state>{}</script>')
    first = {**parts, "missions": known.format(parts["missions"], _safe(looked))}
    contents[""] = _make(HTML, assemble(page.title, first, SCRIPT, POLICY, ("style", "live")))
    return contents


def _safe(text: str) -> Markup:
    return Markup(text.replace("<", "\\u003c"))


def _make(kind: str, text: str) -> Content:
    data = text.encode()
    return Content(kind, data, hashlib.sha256(data).hexdigest()[:16])


Contents = Mapping[str, Content]

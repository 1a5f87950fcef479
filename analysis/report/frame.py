"""A page that opens in any browser without a network, and the missions that it plays."""

import base64
import hashlib
from collections.abc import Mapping, Sequence

from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from .playback import Json
from .templates import read_asset, render


def render_page(
    title: str,
    subtitle: str,
    sections: Mapping[str, Markup],
    playbacks: Sequence[Json],
    grounds: Mapping[str, Json],
    scripts: Sequence[str],
) -> bytes:
    """Render a page.

    A playback has a ``label``, a ``key``, the names of its ``players``, and as ``content`` what
    ``encode_shown`` returns, with ``grounds`` that are shared. ``scripts`` are names in ``web/``.
    """
    script = Markup("\n" + "".join(read_asset(f"{name}.js") for name in scripts))
    return render(
        "page.html",
        policy=_policy(script),
        title=title,
        subtitle=subtitle,
        style=read_asset("style.css"),
        sections=sections,
        playbacks=playbacks,
        grounds=htmlsafe_json_dumps(grounds, separators=(",", ":")),
        script=script,
    ).encode()


def _policy(script: str) -> str:
    """Return the Content-Security-Policy: load nothing, and run this script alone."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )

"""A page that opens in any browser without a network, and the missions that it plays."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from .ground import Json
from .templates import read_asset, render

HEADER, LINKS, MISSIONS = "header", "links", "missions"
"""The parts of a page besides its sections, by their ids."""


@dataclass(frozen=True)
class Page:
    """The content of a page.

    A playback has a ``label``, a ``key``, the names of its ``players``, and as ``content`` what
    ``encode_shown`` returns, with ``grounds`` that are shared.
    """

    title: str
    subtitle: str = ""
    sections: Mapping[str, Markup] = field(default_factory=dict)
    playbacks: Sequence[Json] = ()
    grounds: Mapping[str, Json] = field(default_factory=dict)


def render_parts(page: Page) -> dict[str, Markup]:
    """Render the elements of a page by their ids: the header, the links, sections, missions."""
    names = {name_section(name): name for name in page.sections}
    grounds = htmlsafe_json_dumps(page.grounds, separators=(",", ":"))
    return {
        HEADER: render("header.html", title=page.title, subtitle=page.subtitle),
        LINKS: render("links.html", names=names),
        **{key: render_section(name, page.sections[name]) for key, name in names.items()},
        MISSIONS: render("missions.html", playbacks=page.playbacks, grounds=grounds),
    }


def name_section(name: str) -> str:
    """Return the id of a section."""
    return name.lower().replace(" ", "-")


def render_section(name: str, content: Markup) -> Markup:
    """Render a section of a page."""
    return render("frame.html", key=name_section(name), name=name, content=content)


def render_page(page: Page, scripts: Sequence[str]) -> bytes:
    """Render a page as a file; ``scripts`` are names in ``web/``."""
    script = read_scripts(scripts)
    return assemble(page.title, render_parts(page), script, write_policy(script)).encode()


def assemble(
    title: str,
    parts: Mapping[str, Markup],
    script: Markup,
    policy: str,
    styles: Sequence[str] = ("style",),
) -> Markup:
    """Put the rendered parts of a page together; ``styles`` are names in ``web/``."""
    sections = [part for key, part in parts.items() if key not in (HEADER, LINKS, MISSIONS)]
    style = Markup("").join(read_asset(f"{name}.css") for name in styles)
    values = {"policy": policy, "title": title, "style": style, "script": script}
    return render("page.html", parts=parts, sections=sections, **values)


def read_scripts(names: Sequence[str]) -> Markup:
    """Read scripts of ``web/`` as one."""
    return Markup("\n" + "".join(read_asset(f"{name}.js") for name in names))


def write_policy(script: str, connect: str = "'none'") -> str:
    """Write the Content-Security-Policy: run this script alone, and load nothing.

    The script may ask ``connect``.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        f"img-src data:; connect-src {connect}; base-uri 'none'; form-action 'none'"
    )

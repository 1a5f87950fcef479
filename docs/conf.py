"""The documentation site: the README, the changelog and the pages of this folder, by Sphinx.

    python -m sphinx -W --keep-going -b html -c docs . outputs/site

The source is the root, so that every link leads where it does elsewhere. The pages stay plain
Markdown; what only the site needs is here, in index.rst and in site.css.
"""

import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from notebook import build_notebook  # noqa: E402 - both folders are on the path only now

import evoros  # noqa: E402

project = "evoros"
author = "The evoros developers"
copyright = "2026, The evoros developers"  # noqa: A001 - Sphinx's name
release = version = evoros.__version__

extensions = ["myst_parser"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
root_doc = "docs/index"
include_patterns = ["README.md", "CHANGELOG.md", "docs/**", "evoros/plugins/*/README.md"]
myst_heading_anchors = 6  # as GitHub: every heading can be a link's target
nitpicky = True

html_theme = "furo"
html_title = f"evoros {release.partition('+')[0]}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b62a4", "color-brand-content": "#0b62a4"},
    "dark_css_variables": {"color-brand-primary": "#6db3f2", "color-brand-content": "#6db3f2"},
}
# The languages of blocks that Pygments does not know.
suppress_warnings = ["misc.highlighting_failure"]


def setup(app: Any) -> None:
    """Let Sphinx call what completes the site."""
    app.connect("build-finished", complete_site)


def complete_site(app: Any, error: Exception | None) -> None:
    """Write the page of the root, which leads to the first one, and the tutorial's notebook."""
    if error is None and app.builder.format == "html":
        target = f"{root_doc}.html"
        page = f'<!doctype html><meta http-equiv="refresh" content="0; url={target}">'
        page += f'<title>evoros</title><a href="{target}">evoros</a>\n'
        Path(app.outdir, "index.html").write_text(page)
        Path(app.outdir, "docs", "tutorial.ipynb").write_text(json.dumps(build_notebook()))

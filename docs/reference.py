"""Writes the pages that follow from the code and the leaderboard's rows.

python docs/reference.py           # write the pages
python docs/reference.py --check   # exit with status 1 if a page differs
"""

import sys
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

from generate import configuration, figures, interface, leaderboard  # noqa: E402 - it is on the path only now


def main() -> int:
    """Write the pages, or compare them; returns the exit status."""
    status = 0
    for name, page in write_pages():
        file = DOCS / name
        if "--check" not in sys.argv[1:]:
            file.write_text(page)
        elif not file.is_file() or file.read_text() != page:
            print(f"docs/{name} differs from the code: run python docs/reference.py")
            status = 1
    return status


def write_pages() -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each page."""
    yield "reference.md", configuration.write_page()
    yield "figures.md", figures.write_page()
    yield "leaderboard.md", leaderboard.write_page()
    yield from interface.write_pages()


if __name__ == "__main__":
    raise SystemExit(main())

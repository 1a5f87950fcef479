"""Writes the tutorial as a notebook, docs/tutorial.ipynb: the page is the only source.

python docs/notebook.py [FILE]
"""

import base64
import json
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
TUTORIAL = HERE / "tutorial.md"
PREPARE = """import os
import sys

# The commands of the environment in which this notebook runs, as activating it does.
os.environ["PATH"] = os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"]"""


def build_notebook(page: Path = TUTORIAL) -> dict[str, Any]:
    """Return a notebook in nbformat 4.5: text with its pictures, and a cell for each block."""
    parts = re.split(r"^```bash\n(.*?)^```$", page.read_text(), flags=re.M | re.S)
    cells = []
    for number, part in enumerate(parts):
        name = f"cell-{number}"
        if number % 2 == 0:
            if part.strip():
                cells.append(_text_cell(name, part.strip(), page.parent))
        elif "bin/activate" in part:
            cells.append(_code_cell(name, PREPARE))
        else:
            cells.append(_code_cell(name, f"%%bash -e\n{part.strip()}"))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return {
        "cells": cells,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def _text_cell(name: str, text: str, folder: Path) -> dict[str, Any]:
    attachments = {}
    for path in re.findall(r"\]\((img/[\w.]+\.png)\)", text):
        content = base64.b64encode((folder / path).read_bytes()).decode()
        attachments[Path(path).name] = {"image/png": content}
    text = re.sub(r"\]\(img/([\w.]+\.png)\)", r"](attachment:\1)", text)
    cell = {"cell_type": "markdown", "id": name, "metadata": {}, "source": text}
    return {**cell, "attachments": attachments} if attachments else cell


def _code_cell(name: str, source: str) -> dict[str, Any]:
    return {
        "cell_type": "code",
        "id": name,
        "metadata": {},
        "execution_count": None,
        "outputs": [],
        "source": source,
    }


if __name__ == "__main__":
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "tutorial.ipynb"
    file.write_text(json.dumps(build_notebook(), indent=1) + "\n")
    print(file)

"""evoros.parts, the one import for authors of parts."""

import ast
import subprocess
import sys
from pathlib import Path

from helpers import ROOT

from evoros import parts

SLOW = ("pandas", "matplotlib", "hydra", "omegaconf", "pybullet", "rich", "jinja2")


def test_it_offers_all_that_it_imports_and_nothing_else() -> None:
    tree = ast.parse(Path(parts.__file__).read_text())
    imported = [
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    assert sorted(parts.__all__) == sorted(imported)
    assert len(set(imported)) == len(imported)


def test_it_offers_every_protocol() -> None:
    """A group's protocols are the classes of its protocol.py that users implement."""
    groups = [path.parent.name for path in (ROOT / "evoros").glob("*/protocol.py")]
    assert len(groups) >= 8
    for group in groups:
        # A design has regions; several observers may be chosen.
        word = {"design": "region_description", "observers": "observer"}.get(group, group)
        name = "".join(part.capitalize() for part in word.split("_"))
        assert name in parts.__all__, group


def test_it_imports_nothing_slow_that_a_mission_does_not_need() -> None:
    code = f"import sys, evoros.parts; print([name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"

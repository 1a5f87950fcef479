"""Installations with the same sources share machine code, and damaged code is compiled again."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from evoros.compilation import machine_code
from evoros.compilation import rules as compilation
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, CompiledRule
from evoros.files.resources import PACKAGE
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.filter.silence import Silence

COMPILE = """
import json
import evoros
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, compile_rule
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.filter.silence import Silence

rule = compile_rule(NamedRule(Silence.rule, FILTER_ARGUMENTS, Silence.Parameters), FILTER)
counted = rule._dispatcher.stats
counts = [sum(count.values()) for count in (counted.cache_hits, counted.cache_misses)]
print(json.dumps([evoros.__file__, *counts]))
"""


def compile_in(folder: Path, cache: Path) -> list[object]:
    """The file of evoros in an installation, and how many rules it has loaded and compiled."""
    done = subprocess.run(
        [sys.executable, "-c", COMPILE],
        cwd=folder,
        env={**os.environ, "XDG_CACHE_HOME": str(cache)},
        stdout=subprocess.PIPE,
        check=True,
    )
    counts: list[object] = json.loads(done.stdout)
    return counts


@pytest.mark.slow
def test_equal_sources_share_what_is_compiled_and_others_do_not(tmp_path: Path) -> None:
    """In a clone, the package's analysis is a link, and in a wheel it is a folder."""
    ignored = shutil.ignore_patterns("__pycache__", "robots", "worlds", "conf", "analysis")
    folders = [tmp_path / name for name in ("a", "b", "other")]
    for folder in folders:
        shutil.copytree(PACKAGE, folder / "evoros", ignore=ignored)
        analysis = folder / "evoros" / "analysis"
        if folder.name == "a":
            analysis.symlink_to(PACKAGE / "analysis")
        else:
            shutil.copytree(PACKAGE / "analysis", analysis, ignore=ignored)
    rule = folders[2] / "evoros" / "filter" / "silence.py"
    rule.write_text(rule.read_text() + "# changed\n")
    files = [str(folder / "evoros" / "__init__.py") for folder in folders]
    counts = [compile_in(folder, tmp_path / "cache") for folder in folders]
    assert counts == [[files[0], 0, 1], [files[1], 1, 0], [files[2], 0, 1]]


RULE = NamedRule(Silence.rule, FILTER_ARGUMENTS, Silence.Parameters)
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "half": lambda content: content[: len(content) // 2],
    "zeros": lambda content: bytes(len(content)),
    "half zeros": lambda content: content[: len(content) // 2] + bytes(len(content) // 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_code_is_compiled_anew_and_kept(
    suffix: str, damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine_code, "cache_folder", lambda: tmp_path)
    compile_anew()
    (file,) = tmp_path.rglob(f"*{suffix}")
    damaged = DAMAGES[damage](file.read_bytes())
    file.write_bytes(damaged)
    compile_anew()
    assert file.read_bytes() != damaged
    before = file.stat().st_mtime_ns
    compile_anew()
    assert file.stat().st_mtime_ns == before  # it was loaded


def compile_anew() -> None:
    """Compile or load a rule as a new process does."""
    rule = compilation._compile.__wrapped__(RULE, FILTER)
    assert isinstance(rule, CompiledRule)

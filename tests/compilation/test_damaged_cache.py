"""Compiled code on disk that cannot be loaded is made anew, and does not block anybody."""

from collections.abc import Callable
from pathlib import Path

import pytest

from evoros.compilation import machine_code
from evoros.compilation import rules as compilation
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.rules import FILTER, CompiledRule
from evoros.filter.protocol import FILTER_ARGUMENTS
from evoros.filter.silence import Silence

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

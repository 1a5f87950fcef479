"""A path with a space whose quotes are missing: one line says so, and how it is typed."""

import shlex
from pathlib import Path

import pytest
from fixture_types import Capture, Patch
from helpers import TINY, finished_run
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.config.compose import parse
from evoros.terminal.console import DONE, INPUT, require_keys

SPLIT = [
    ("hydra.run.dir=out put/x", "'put/x': must be key=value", "'hydra.run.dir=\"out put/x\"'"),
    ("seed=1 hydra.run.dir=a b c trials=2", "'b': must be key=value", "'hydra.run.dir=\"a b c\"'"),
    ("evaluate designs=out put/x", "'put/x': must be key=value", "'designs=\"out put/x\"'"),
    ("evaluate out put/x trials=2", "'out': must be key=value", "'like=\"out put/x\"'"),
    ("evaluate out", "'out': must be key=value", "type like=out"),
    ("resume out put", "'put': must be key=value", "'out put'"),
    ("reproduce out put", "'put': must be key=value", "'out put'"),
    ("world out put.sdf", "'put.sdf': must be key=value", "'out put.sdf'"),
    ("status out put", "unexpected argument put", "'out put'"),
    ("diff a out put", "unexpected argument put", "'out put'"),
    ("status --once --nix", "unexpected argument --nix", "see evoros status --help"),
]


@pytest.mark.parametrize(("line", "said", "advised"), SPLIT)
def test_a_word_that_stands_alone_is_told_with_the_quotes_that_it_lacks(
    line: str, said: str, advised: str, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert evoros(line.split()) == INPUT
    (told,) = capsys.readouterr().err.splitlines()
    assert f": {said}" in told
    assert advised in told
    assert list(tmp_path.iterdir()) == []


words = st.text("ab/._-2", min_size=1, max_size=4)


@given(st.lists(words, min_size=2, max_size=4))
def test_what_is_advised_gives_the_whole_path_to_hydra(parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        require_keys(["seed=1", f"hydra.run.dir={parts[0]}", *parts[1:]], "")
    (typed,) = shlex.split(str(caught.value).partition("quotes: ")[2])
    (override,) = parse([typed])
    assert override.value() == " ".join(parts)


@pytest.mark.slow
def test_a_figure_of_a_folder_with_a_space(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    finished_run(Path("out put") / "x")
    capsys.readouterr()
    for before in ([], ["out put"]):
        assert evoros(["analyze", "fitness", *before, "out", "put/x"]) == INPUT
        told = capsys.readouterr().err.splitlines()[-1]
        assert told.startswith("evoros analyze: out: folder not found")
        assert told.endswith("a path with a space needs quotes: 'out put/x'")
    assert evoros(["analyze", "fitness", "out put/x"]) == DONE
    assert evoros(["analyze", "fitness", "nix"]) == INPUT
    assert capsys.readouterr().err.endswith("; check the spelling of the path\n")


@pytest.mark.parametrize("quoted", ["hydra.run.dir=out put", 'hydra.run.dir="out put"'])
def test_a_quoted_path_with_a_space_needs_no_further_quotes(
    quoted: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = ["optimizer.generations=1", "optimizer.validation_trials=0", "executor=serial"]
    assert evoros([*TINY, quoted, *short]) == DONE
    assert [path.name for path in tmp_path.iterdir()] == ["out put"]

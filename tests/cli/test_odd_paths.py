"""Odd paths: commands work in them, and one line names an impossible path or missing quotes."""

import os
import shlex
from http import HTTPStatus
from pathlib import Path
from urllib.request import urlopen

import pytest
from fixture_types import Capture, Patch
from helpers import TINY, USER_PARTS, finished_run, start
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.subcommands import SUBCOMMANDS
from evoros.base.errors import InputError, quote_value
from evoros.cli.main import evoros
from evoros.config.compose import parse
from evoros.files.plugins import explain_missing
from evoros.terminal.console import DONE, INPUT, require_keys

COMMANDS = (
    *("resume {}", "analyze report {}", "analyze fitness {}", "archive {}", "status {}"),
    *("watch {}", "reproduce {}", "replay {} world=w", "evaluate like={}", "inspect world {}"),
    *("inspect robot {}", "world {}", "experiment=quickstart executor=serial hydra.run.dir={}/run"),
)


def can_be_typed(line: str) -> bool:
    """Return False for a subcommand of a plug-in that is not there."""
    return not explain_missing(line.split()[0])


@pytest.fixture(params=["long name", "loop of links"])
def impossible(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A path that the system refuses."""
    if request.param == "long name":
        return tmp_path / ("n" * 300)
    (tmp_path / "one").symlink_to("two")
    (tmp_path / "two").symlink_to("one")
    return tmp_path / "one"


@pytest.mark.parametrize("line", [line for line in COMMANDS if can_be_typed(line)])
def test_an_impossible_path_is_named_in_one_line(
    line: str, impossible: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    status = evoros(shlex.split(line.format(impossible)))
    errors = capsys.readouterr().err.splitlines()
    assert status == INPUT
    assert impossible.name in errors[-1]


ODD = os.fsdecode(b"\xc3\xa4 caf\xe9 x='1,2\"#%&;$ [a]{b}")  # one byte of it is no UTF-8
PARTS = f"--config-dir {shlex.quote(str(USER_PARTS))}"
FIRST = "world=near generation=0 design=0 trial=0"
RUNS = (
    *("status {}", "diff {} {}", f"resume {{}} {PARTS}", f"replay {{}} {FIRST} {PARTS}"),
    *(f"archive {{}} {PARTS} --output {{}}.zip", "status {}.zip", "diff {} {}.zip"),
    *(f"reproduce {{}} {PARTS} --output {{}}-again", f"export recorder {{}} {PARTS}"),
    *("inspect robot {}/champion/robot.urdf", "inspect world {}/champion/world_near.sdf"),
    "world {}.sdf world.generated.seed=3",
    "inspect world {}.sdf",
    *(f"analyze {name} {{}} --output {{}}-{name}" for name in SUBCOMMANDS),
)
TYPED = (  # by Hydra's grammar, which has quotes of its own
    f"evaluate {PARTS} executor=serial trials=1 like={{}} hydra.run.dir={{}}-scored",
    f"{PARTS} experiment=tiny executor=serial optimizer.generations=1 hydra.run.dir={{}}-new",
    f"-m {PARTS} experiment=tiny executor=serial optimizer.generations=1 seed=1,2 "
    "hydra.sweep.dir={}-swept",
)
SWEPT = ("status {}-swept", "diff {}-swept {}-swept", "analyze fitness {}-swept --output {}-fit")
"""Lines that read what a line of ``TYPED`` has made."""
NEED_MORE = (
    *("archive", "controls", "factors", "failure", "front", "power", "regression", "requirements"),
    *("transfer", "worst"),
)
"""Subcommands of ``analyze`` that one run does not suffice for."""


def watch(run: Path) -> int:
    """Follow a run until a signal; return whether the page has it."""
    process = start(["watch", str(run)], run.parent)
    with process:
        assert process.stdout is not None
        with urlopen(process.stdout.readline().strip(), timeout=60) as page:
            found = page.status == HTTPStatus.OK and b"<html" in page.read().lower()
        process.terminate()
    return DONE if found else INPUT


@pytest.mark.slow
def test_every_subcommand_works_in_a_folder_with_an_odd_name(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    folder = tmp_path / ODD
    folder.mkdir()
    run = finished_run(folder / ODD, "optimizer.generations=2", "record=all")
    monkeypatch.chdir(folder)
    refused = set()
    for line in (*RUNS, *TYPED, *SWEPT):
        words = [word.replace("{}", str(run)) for word in shlex.split(line)]
        if line in TYPED:
            pairs = (word.partition("=") for word in words)
            odd = str(run)
            words = [f"{k}={quote_value(v)}" if odd in v else f"{k}{eq}{v}" for k, eq, v in pairs]
        status = evoros(words)
        assert status in (DONE, INPUT), line
        if status == INPUT:
            refused.add(" ".join(line.split()[:2]))
    assert refused == {f"analyze {name}" for name in NEED_MORE}
    assert watch(run) == DONE


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


@pytest.mark.parametrize(
    ("line", "said", "advised"), [row for row in SPLIT if can_be_typed(row[0])]
)
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

"""One command: its subcommands, their help, completion, and what is typed instead of them."""

import re
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from functools import cache
from io import StringIO

import pytest

from evoros.analysis.subcommands import SUBCOMMANDS as FIGURES
from evoros.cli.command import parse_options
from evoros.cli.main import complete, evoros
from evoros.cli.subcommands import SUBCOMMANDS
from evoros.terminal.console import DONE, INPUT

COMPOSING = ("evaluate",)
"""The subcommands that have Hydra's options."""
VALUES = {"--config-dir": ["mine"], "--cfg": ["job"], "--package": ["robot"]}


@cache
def ask_help(*subcommand: str) -> str:
    with redirect_stdout(StringIO()) as output:
        assert evoros([*subcommand, "--help"]) == DONE
    return output.getvalue()


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_the_help_has_each_subcommand_as_the_table_has_it(name: str) -> None:
    subcommand = SUBCOMMANDS[name]
    line = rf"^evoros {name} {re.escape(subcommand.arguments)} +{re.escape(subcommand.about)}$"
    assert re.search(line, ask_help(), re.M)
    assert f"evoros {name}" in ask_help(name)


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_the_help_fits_a_hundred_columns(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    ask_help.cache_clear()
    assert max(map(len, ask_help(name).splitlines())) <= 100


@pytest.mark.parametrize("name", [name for name in SUBCOMMANDS if name != "analyze"])
def test_the_table_has_the_options_of_the_parsers(name: str) -> None:
    options = SUBCOMMANDS[name].options
    if name in COMPOSING:
        assert all(parse_options([option, *VALUES.get(option, [])]) for option in options)
        return
    shown = set(re.findall(r"(?<![\w-])--[\w-]+", ask_help(name))) - {"--help"}
    assert shown == set(options)


@pytest.mark.parametrize("figure", ["overlay", "deploy", "regression", "report"])
def test_the_table_has_what_all_figures_have(figure: str) -> None:
    assert all(option in ask_help("analyze", figure) for option in SUBCOMMANDS["analyze"].options)


@pytest.mark.parametrize(
    ("arguments", "fix"),
    [
        (["evalute", "designs=x"], "type: evoros evaluate"),
        (["reprodcue", "outputs/x"], "type: evoros reproduce"),
        (["evoros-diff", "a", "b"], "type: evoros diff"),
        (["evoros-evaluate"], "type: evoros evaluate"),
        (["overlay", "outputs/x"], "type: evoros analyze overlay"),
        (["resume=outputs/a b"], "type: evoros resume 'outputs/a b'"),
        (["evaluate", "resume=outputs/x"], "type: evoros resume outputs/x"),
        (
            ["designs=a.csv", "seed=2"],
            "only evoros evaluate has this key; type: evoros evaluate designs=a.csv",
        ),
        (["-m", "like=r", "seed=1,2"], "type: evoros evaluate -m like=r"),
        (["nonsense"], "key=value or a subcommand (evaluate, resume, analyze,"),
        (["failure=none", "status"], "status: a subcommand must come first; type: evoros status"),
        (
            ["diff", "a", "b", "--once"],
            "--once: belongs to evoros status, not to evoros diff, which has",
        ),
        (
            ["status", "--output=x"],
            "--output: belongs to evoros analyze, replay, reproduce, archive, not to evoros",
        ),
        (
            ["evaluate", "--where=a=b"],
            "--where: belongs to evoros analyze, not to evoros evaluate, which has",
        ),
        (["resume", "missing"], "missing: folder not found;"),
        (["analyze", "outputs/x", "overlay"], "type: evoros analyze overlay outputs/x"),
        (["analyze", "overley", "outputs/x"], "type: evoros analyze overlay"),
        (["analyze", "overlay", "fitness"], "fitness: the name of a figure, not a folder"),
        (["analyze", "status"], "type: evoros status"),
        (["analyze", "folder1"], "folder1: not the name of a figure; choose from overlay,"),
        (["analyze", "overlay", "x", "--margin=1"], "an option of evoros analyze regression;"),
        (["analyze", "overlay", "x", "--nix"], "--nix: not an option of overlay; see"),
    ],
)
def test_a_slip_is_answered_by_one_line_with_the_fix(
    arguments: list[str], fix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evoros(arguments) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert fix in line


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "evoros re",
            {"resume", "reproduce", "replay", "record=", "requirements=", "requirements."},
        ),
        ("evoros evaluate simulator=mu", {"simulator=mujoco"}),
        ("evoros analyze ", set(FIGURES)),
        ("evoros status ", {"--once"}),
    ],
)
def test_the_shell_completes(
    line: str, words: set[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COMP_LINE", line)
    assert complete("query=bash") == DONE
    assert set(capsys.readouterr().out.split()) == words


def test_options_may_stand_among_overrides(capsys: pytest.CaptureFixture[str]) -> None:
    options = parse_options(["seed=1", "-m", "trials=2,3", "--config-dir", "mine", "world=maze"])
    assert options.overrides == ["seed=1", "trials=2,3", "world=maze"]
    assert (options.multirun, options.config_dir) == (True, "mine")
    assert evoros(["seed=17", "--cfg", "job", "trials=19"]) == DONE
    assert {"seed: 17", "trials: 19"} <= set(capsys.readouterr().out.splitlines())


@pytest.mark.slow
def test_an_answer_of_hydra_that_nobody_reads_to_its_end_is_no_error() -> None:
    code = f"{shlex.quote(sys.executable)} -m evoros --info defaults | head -1"
    process = subprocess.run(code, shell=True, capture_output=True, text=True, check=True)
    assert process.stderr == ""

"""Commands and words that are printed to be typed, typed in bash as they stand in a new process."""

import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from helpers import TINY, USER_PARTS, cut, finished_run
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import escape, override, unescape
from evoros.cli.main import evoros
from evoros.terminal.console import DONE, INPUT, NOT_DECIDED, NOT_MET

OWN = ("--config-dir", str(USER_PARTS), "executor=serial")
AWKWARD = os.fsdecode(b'x=1,2 \xc3\xa4 caf\xe9#%\t it\'s "so" [1] {c} $(no) $HOME \\')
"""A name with all that bash, Hydra or Python may read in another way; a byte is no UTF-8."""
COMMAND = re.compile(r"(?<!\S)evoros (?:resume|evaluate|replay|status|analyze) .*", re.ASCII)
MAIN = "from evoros.cli.main import main; main()"
EVOROS = f'evoros() {{ {shlex.quote(sys.executable)} -c "{MAIN}" "$@"; }}'


def run_in_bash(line: str) -> "subprocess.CompletedProcess[bytes]":
    """Type a line, with fewer trials, in a new process, which knows no parts of other commands."""
    typed = f"{EVOROS}\n{re.sub(r' trials=[0-9]+', ' trials=3', line)}"
    return subprocess.run(["bash", "-c", os.fsencode(typed)], capture_output=True, check=False)


@pytest.mark.slow
def test_every_printed_command_does_what_its_line_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also with parts of the user's own, in a folder with an awkward name."""
    name = AWKWARD
    monkeypatch.chdir(tmp_path)
    finished_run(tmp_path / name)

    def printed(*words: str) -> list[str]:
        with redirect_stdout(StringIO()) as output, redirect_stderr(output):
            evoros(words)
        commands = COMMAND.findall(output.getvalue())
        assert commands, words
        return [command.removesuffix("; left out") for command in commands]

    like, tested = override("like", name), override("hydra.run.dir", f"{name}-tested")
    commands = [
        *printed(f"resume={name}"),
        *printed(*TINY, *OWN, override("hydra.run.dir", name)),
        *printed(*TINY, *OWN, override("hydra.run.dir", f"{name}-new"), "optimizer.generations=1"),
        *printed("evaluate", *OWN, like, "requirements=delivery", "trials=2", tested),
        *printed("evaluate", *OWN, like, tested),
    ]
    statuses = {line: run_in_bash(line).returncode for line in dict.fromkeys(commands)}
    finished_run(tmp_path / f"{name}-cut")
    cut(tmp_path / f"{name}-cut", 2000)
    for line in printed("analyze", "report", f"{name}-cut"):
        statuses[line] = run_in_bash(line).returncode
    assert len(statuses) > 6
    assert set(statuses.values()) <= {DONE, NOT_MET, NOT_DECIDED}, statuses


def test_words_with_the_proposed_quotes_are_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    name = os.fsdecode(b"caf\xe9 \xfcber $HOME 'a'")
    Path(name).mkdir()

    def propose(*words: str) -> str:
        assert evoros(words) == INPUT
        error = capsys.readouterr().err
        line = re.search(r"(?:quotes:|type) (.*?)(; see .*)?$", error)
        assert line, error
        split = subprocess.run(
            ["bash", "-c", f"printf %s {line[1]}"], capture_output=True, check=True
        )
        return os.fsdecode(split.stdout)

    split = name.split(" ")
    assert propose("status", *split) == name
    assert propose("analyze", "fitness", *split) == name
    quoted = propose("+treatment.name=" + os.fsdecode(b"caf\xe9"), "noir")
    assert evoros([*TINY, *OWN, quoted, "--cfg", "job"]) == DONE
    assert "noir" in capsys.readouterr().out


@given(st.binary(max_size=9))
def test_a_path_is_restored_from_its_text(path: bytes) -> None:
    name = os.fsdecode(path)
    if "\\udc" not in name:
        assert unescape(escape(name)) == name

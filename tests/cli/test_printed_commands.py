"""Commands and words that are printed to be typed, typed in bash as they stand in a new process."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from fixture_types import Capture, Patch
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
EVOROS = "evoros() { printf '%s\\0' \"$@\"; }"
RUN = """
import json, os, sys
import evoros.analysis.command, evoros.cli.command, evoros.session.run
from evoros.cli.main import evoros
for words in json.loads(sys.argv[1]):
    child = os.fork()
    if not child:
        os._exit(evoros(words))
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), file=sys.stderr, flush=True)
"""


def split_in_bash(line: str) -> list[str]:
    """Type a line, with fewer trials, and return the words of the command."""
    typed = f"{EVOROS}\n{re.sub(r' trials=[0-9]+', ' trials=3', line)}"
    done = subprocess.run(["bash", "-c", os.fsencode(typed)], capture_output=True, check=True)
    return [os.fsdecode(word) for word in done.stdout.split(b"\0")[:-1]]


def run_apart(lines: Iterable[str]) -> dict[str, int]:
    """Run each line in a process that knows no parts of other commands; return the statuses."""
    typed = {line: split_in_bash(line) for line in lines}
    command = [sys.executable, "-c", RUN, json.dumps([*typed.values()])]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=True)
    told = [int(line) for line in done.stderr.splitlines() if line.isdecimal()]
    return dict(zip(typed, told, strict=True))


@pytest.mark.slow
def test_every_printed_command_does_what_its_line_says(tmp_path: Path, monkeypatch: Patch) -> None:
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
    finished_run(tmp_path / f"{name}-cut")
    cut(tmp_path / f"{name}-cut", 2000)
    statuses = run_apart([*commands, *printed("analyze", "fitness", f"{name}-cut")])
    assert len(statuses) > 6
    assert set(statuses.values()) <= {DONE, NOT_MET, NOT_DECIDED}, statuses


def test_words_with_the_proposed_quotes_are_taken(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
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

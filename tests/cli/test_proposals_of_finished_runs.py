"""What a message about finished runs proposes can be typed, and then the message stays away."""

import shlex
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from helpers import cut, finished_run
from proposal_sites import is_of, list_alternatives, replaces
from typed_finished import CASES, QUICK, WORDS, Finished, Step

from evoros.analysis.drawing import style
from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.files.plugins import find_plugins
from evoros.terminal.console import DONE, INPUT, NOT_DECIDED, NOT_MET

Words = tuple[str, ...]
Read = Callable[[], str]


@pytest.fixture(autouse=True)
def few_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the subcommand paper draw one figure of each selection of runs."""
    if "evo_ros_2018" in find_plugins():
        from evoros.plugins.evo_ros_2018 import numbered_figures as paper

        monkeypatch.setattr(paper, "FIGURES", (paper.FIGURES[1], *paper.FIGURES[-4:]))


@pytest.fixture
def read(capsys: pytest.CaptureFixture[str]) -> Read:
    def read() -> str:
        output = capsys.readouterr()
        return output.out + output.err

    return read


def take(step: Step, read: Read, proposed: Words = ()) -> tuple[bool, str]:
    """Take a step; return whether it was accepted, and the output."""
    if not isinstance(step, str):
        try:
            result = step(proposed)
        except InputError as error:
            return False, str(error)
        return True, f"{result}{read()}"
    for name, text in WORDS.items():
        step = step.replace(name, text)
    words = shlex.split(step)
    if words[0] == "cut":
        run = Path(words[1])
        cut(run, (run / "missions.csv").stat().st_size - 9)
        return True, ""
    status = evoros(words)
    assert status in (DONE, INPUT, NOT_MET, NOT_DECIDED)
    return status != INPUT, read()


def find_messages(output: str, key: str) -> list[str]:
    """Return the lines of an output that are messages of a key, or the paragraphs of a help."""
    lines = [line for line in output.splitlines() if is_of(line, key)]
    return lines or [text for text in output.split("\n\n") if is_of(text, key)]


def prepare(case: Finished, folder: Path, read: Read) -> None:
    for name, words in case.runs.items():
        finished_run(folder / name, *QUICK, *words.split())
    for step in case.made:
        accepted, output = take(step, read)
        assert accepted, output


def list_steps(case: Finished, proposed: Words) -> Iterator[Step]:
    """Yield the steps in which a proposal is typed."""
    for step in case.typed or [case.asked]:
        if not isinstance(step, str):
            yield step
        elif case.typed:
            yield step.replace("{}", shlex.join(proposed))
        else:
            chosen = {word.lstrip("+~").partition("=")[0] for word in proposed}
            kept = [word for word in step.split() if not replaces(chosen, word)]
            yield " ".join([*kept, shlex.join(proposed)])


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[pytest.mark.slow] * (not case.quick), id=case.key)
        for case in CASES
    ],
)
def test_a_message_stays_away_once_a_proposal_is_typed(
    case: Finished, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Read
) -> None:
    monkeypatch.setattr(style, "save", lambda *_: None)  # no message tells of a picture

    def enter(name: str) -> None:
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        prepare(case, tmp_path / name, read)

    enter("asked")
    _, output = take(case.asked, read)
    keys = (case.key, *case.others)
    found = [find_messages(output, key) for key in keys]
    assert all(found), output
    messages = [message for of_key in found for message in of_key]
    for number, (proposed, lines) in enumerate(group(messages, case.filled).items()):
        enter(f"{number}")
        for step in list_steps(case, proposed):
            accepted, output = take(step, read, proposed)
            assert accepted, output
        left = {message for key in keys for message in find_messages(output, key)}
        assert left <= set(messages) - set(lines)


def group(messages: Sequence[str], filled: Mapping[str, str]) -> dict[Words, list[str]]:
    """Map what is proposed to the messages that propose it."""
    alternatives: dict[Words, list[str]] = defaultdict(list)
    for message in messages:
        for proposed in list_alternatives(message, filled) or [[]]:
            alternatives[tuple(proposed)].append(message)
    return alternatives

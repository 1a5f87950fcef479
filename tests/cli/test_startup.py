"""What happens before the first mission: in processes of their own, for imports leave traces."""

import re
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from helpers import TINY, everything, tiny

from evoros.cli import main as cli
from evoros.files.resources import find_file
from evoros.terminal.console import DONE, INPUT, INTERRUPTED, STOPPED

SLOW = ("pybullet", "matplotlib", "pandas")
BREAK = "----"
SCRIPT = f"""
import logging, sys
from evoros.cli.main import evoros

def say_what_is_imported():
    print([name for name in {SLOW} if sys.modules.get(name)])

class First(logging.Handler):
    def emit(self, record):
        logging.getLogger("evoros").removeHandler(self)
        print(record.getMessage())
        say_what_is_imported()
        raise KeyboardInterrupt

logging.getLogger("evoros").addHandler(First())
print(evoros(["executor.workers=1", "hydra.run.dir=run"]))
sys.modules["pybullet"] = None
print("{BREAK}")
print(evoros({[*TINY, "executor=serial", "optimizer.generations=1", "hydra.run.dir=tiny"]}))
say_what_is_imported()
print("{BREAK}")
print("{BREAK}", file=sys.stderr)
print(evoros(["simulator=pybullet", "hydra.run.dir=none"]))
"""
"""The default experiment until its first line; then, as if PyBullet were not installed, a run by
a user's own simulator and one in PyBullet.
"""


@dataclass(frozen=True)
class Answers:
    """The folder in which commands ran, the output of each and the last one's errors."""

    folder: Path
    outputs: list[list[str]]
    errors: str


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Answers:
    folder = tmp_path_factory.mktemp("startup")
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    outputs = [text.splitlines() for text in done.stdout.split(f"{BREAK}\n")]
    return Answers(folder, outputs, done.stderr.split(f"{BREAK}\n")[1])


@pytest.mark.slow
def test_nothing_slow_is_imported_before_the_first_line(answers: Answers) -> None:
    """Of a run of the default experiment; workers import the engine, the command never does."""
    message, imported, _ = answers.outputs[0]
    assert message.startswith("run: 25 generations")
    assert imported == "[]"


@pytest.mark.slow
def test_a_users_own_simulator_needs_no_engine_and_the_command_nothing_slow(
    answers: Answers,
) -> None:
    """Neither PyBullet, which is not installed here, nor pandas or matplotlib."""
    assert answers.outputs[1][-2:] == [f"{DONE}", "[]"]


@pytest.mark.slow
def test_a_missing_engine_is_one_line_and_leaves_no_folder(answers: Answers) -> None:
    assert answers.outputs[2] == [f"{INPUT}"]
    assert re.match("evoros: simulator.*PyBullet is not installed", answers.errors)
    assert answers.errors.count("\n") == 1
    assert not (answers.folder / "none").exists()


@pytest.mark.parametrize("name", ["evoros", "evoros-analyze"])
def test_ctrl_c_while_a_command_is_imported_is_one_line(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupted:
        def find_spec(self, *_: object) -> None:
            raise KeyboardInterrupt

    (script,) = entry_points(group="console_scripts", name=name)
    module = {"evoros": "evoros.cli.main", "evoros-analyze": "evoros.analysis.command"}[name]
    main = script.load()
    monkeypatch.delitem(sys.modules, module, raising=False)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "meta_path", [Interrupted()])
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code == INTERRUPTED
    assert capsys.readouterr().err == f"{name}: interrupted\n"


def test_warnings_of_the_readers_are_on_the_terminal_and_in_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = tmp_path / "odd.sdf"
    sdf = find_file("boxes.sdf", "worlds").read_text()
    world.write_text(sdf.replace("</link>", "<my:nonsense xmlns:my='urn:my'/></link>", 1))
    folder = tmp_path / "run"
    assert tiny(folder, f"world.near.sdf={world}", "optimizer.generations=1") == DONE
    said = capsys.readouterr().err
    warnings = [line for line in said.splitlines() if "nonsense" in line]
    assert warnings
    log = (folder / "evoros.log").read_text().splitlines()
    for warning in warnings:
        assert sum(line.endswith(f"WARNING {warning}") for line in log) == 1
    assert "1 generation, seed" in log[len(warnings)]


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (ZeroDivisionError("no\nluck"), STOPPED, ", in failing: ZeroDivisionError: no luck\n"),
        (KeyboardInterrupt(), INTERRUPTED, "evoros: interrupted\n"),
    ],
)
def test_nothing_is_promised_of_a_run_that_never_began(
    error: BaseException,
    status: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Neither a traceback in a log nor a folder to resume, for there is none; but the place."""

    def failing(*_: object) -> None:
        raise error

    monkeypatch.setattr("evoros.session.run.manifest", failing)
    assert cli.evoros([*TINY, "executor=serial", f"hydra.run.dir={tmp_path / 'run'}"]) == status
    err = capsys.readouterr().err
    assert err.endswith(said)
    assert err.startswith("evoros: interrupted" if status == INTERRUPTED else f"evoros: {__file__}")
    assert err.count("\n") == 1
    assert everything(tmp_path) == {}

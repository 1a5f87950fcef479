"""A user without a home or an entry in the list of users, as in many containers."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import ROOT, TINY, USER_PARTS

from evoros.compilation.machine_code import cache_folder

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.geteuid() != 0, reason="only root can become an unknown user"),
    pytest.mark.skipif(not shutil.which("setpriv"), reason="needs setpriv of util-linux"),
]
UNKNOWN = 54321
AS_UNKNOWN = (
    *("setpriv", f"--reuid={UNKNOWN}", f"--regid={UNKNOWN}", "--clear-groups"),
    *("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"),
)
"""Becomes the unknown user, who can read the environment of Python if it lies in root's home."""
PARTS = ["--config-dir", str(USER_PARTS)]
LINES = (
    [*TINY, "executor.workers=1", "optimizer.generations=1", "hydra.run.dir=run"],
    ["resume", "run", *PARTS, "optimizer.generations=2", "executor=serial"],
    ["status", "run"],
    ["analyze", "fitness", "run"],
    ["archive", "run", *PARTS, "--output", "run.zip"],
    ["inspect", "robot", "run/champion/robot.urdf"],
)
CALLS = """
import json, sys
from evoros.cli.main import evoros
statuses = [evoros(line) for line in json.loads(sys.argv[1])]
print("\\n", json.dumps(statuses))
"""


def call(code: str, lines: object, folder: Path) -> "subprocess.CompletedProcess[str]":
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "LC_ALL") if name in os.environ}
    return subprocess.run(
        [*AS_UNKNOWN, sys.executable, "-c", code, json.dumps(lines)],
        cwd=folder,
        env={**kept, "TMPDIR": str(folder.parent / "tmp"), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def work() -> Iterator[Path]:
    """The folder of the user, in one of somebody else; the parents of tmp_path are closed."""
    with tempfile.TemporaryDirectory() as name:
        above = Path(name)
        above.chmod(0o755)
        for folder in ("work", "tmp"):
            (above / folder).mkdir()
            os.chown(above / folder, UNKNOWN, UNKNOWN)
        share_machine_code(above / "tmp" / f"evoros-{UNKNOWN}" / "evoros")
        yield above / "work"


def share_machine_code(cache: Path) -> None:
    """Give the user a copy of the machine code that others have, which takes long to compile."""
    known = cache_folder()
    assert known is not None
    shutil.copytree(known, cache / known.name)
    for path in (cache.parent, cache, *cache.rglob("*")):
        os.chown(path, UNKNOWN, UNKNOWN)
        path.chmod(0o700)


def test_every_command_works_and_leaves_nothing_but_its_results(work: Path) -> None:
    done = call(CALLS, LINES, work)
    assert "Traceback" not in done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == [0] * len(LINES), done.stderr
    assert {path.name for path in work.iterdir()} == {"mine", "run", "run.zip"}
    assert {path.name for path in work.parent.iterdir()} == {"tmp", "work"}
    assert {path.name for path in (work.parent / "tmp").iterdir()} <= {f"evoros-{UNKNOWN}"}

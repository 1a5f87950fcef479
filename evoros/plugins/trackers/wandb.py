"""An observer that writes offline runs for Weights & Biases, to be uploaded by ``wandb sync``."""

import json
import os
import shutil
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from evoros.base.checks import TEXT, checked
from evoros.base.errors import require_extra
from evoros.files.resources import expand_home
from evoros.observers.protocol import ObservedRun, Observer, Send

DEFAULTS = {"WANDB_ERROR_REPORTING": "false", "WANDB_SILENT": "true"}
"""Default values of environment variables."""
FOREIGN = "WANDB_RUN_ID", "WANDB_SWEEP_ID", "WANDB_RESUME", "WANDB_RUN_GROUP", "WANDB_NAME"
"""Variables with which a sweep's agent names a single run; they would override arguments."""
FILE_HEADER, HEADER, BLOCK = 7, 7, 32768  # sizes [bytes] in a log: its header, a piece's, a block
PIECES, LAST_PIECES = (1, 2, 3, 4), (1, 4)  # kinds of pieces, and kinds that end a record
QUIET = "silent", "disable_git", "disable_job_creation", "x_disable_meta", "x_disable_stats"
PATIENCE_S = 30.0
NOTE = "evoros.json"  # file in a completed offline run that describes its content


@dataclass(frozen=True)
@checked
class Wandb(Observer):
    """An observer that writes offline runs to ``folder``/wandb, without network access."""

    project: Annotated[str, TEXT] = "evoros"
    folder: Annotated[str, TEXT] = "outputs"

    def check(self) -> None:
        """Check that the wandb package is installed."""
        for name, value in DEFAULTS.items():
            os.environ.setdefault(name, value)
        for name in FOREIGN:
            os.environ.pop(name, None)
        with require_extra("wandb", "observers=wandb"):
            import wandb  # noqa: F401

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        """Find the offline runs of earlier sessions, and open one for this session."""
        self.check()
        folder = run.origin / expand_home(self.folder)
        with closing(_OfflineRun(self.project, folder, run.id)) as offline:
            yield offline.send


class _OfflineRun:
    """An offline run that replaces earlier sessions' runs, so that ``wandb sync`` finds one."""

    def __init__(self, project: str, folder: Path, run_id: str) -> None:
        self.project, self.folder, self.id = project, folder, run_id
        self._earlier = sorted((folder / "wandb").glob(f"offline-run-*-{run_id}"))
        notes = [_read_note(path) for path in self._earlier]
        self.known: dict[str, Any] = max(notes, key=lambda n: n["generations"], default=_note(0))
        self._session: Any = None

    def send(self, run: ObservedRun) -> None:
        digest = "" if run.end is None else run.end.digest
        more = len(run.generations) > self.known["generations"]
        if not more and digest in ("", self.known["digest"]) and (self._session or self._earlier):
            return
        if self._session is None:
            self._start(run)
        for generation in run.generations[self.known["generations"] :]:
            self._session.log(dict(generation.metrics), step=generation.number)
        if run.end is not None:
            self._session.summary.update({"state": run.end.state, **run.end.metrics})
            for name, content in run.end.files.items():
                file = Path(self._session.dir) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
                self._session.save(str(file), base_path=self._session.dir, policy="now")
        self.known = _note(len(run.generations), digest)

    def _start(self, run: ObservedRun) -> None:
        import wandb

        self.folder.mkdir(parents=True, exist_ok=True)
        # Names contain the second, so a run started within the same second would be overwritten.
        while any(time.strftime("%Y%m%d_%H%M%S") in path.name for path in self._earlier):
            time.sleep(0.05)
        self.known = _note(0)
        # wandb records the command line, and fails unless it is valid UTF-8.
        sys.argv = [word.encode(errors="replace").decode() for word in sys.argv]
        self._session = wandb.init(
            mode="offline",
            project=self.project,
            dir=str(self.folder),
            id=self.id,
            name=run.name,
            group=run.group,
            config=dict(run.parameters),
            reinit="create_new",
            settings=wandb.Settings(console="off", save_code=False, **dict.fromkeys(QUIET, True)),
        )

    def close(self) -> None:
        """Complete the offline run, and delete the runs it replaces."""
        if self._session is None:
            return
        place = Path(self._session.dir).parent
        self._session.finish()
        _wait_for_end(place / f"run-{self.id}.wandb")
        (place / NOTE).write_text(json.dumps(self.known), encoding="utf-8")
        for path in self._earlier:
            if path != place:
                shutil.rmtree(path)


def _wait_for_end(log: Path) -> None:
    """Wait until wandb's process has written the last record of an offline run."""
    end = time.monotonic() + PATIENCE_S
    while not any(record.WhichOneof("record_type") == "exit" for record in read_log(log)):
        if time.monotonic() > end:
            raise TimeoutError(f"{log}: was not completed in {PATIENCE_S:g} s")
        time.sleep(0.02)


def read_log(path: Path) -> Iterator[Any]:
    """Yield the records of an offline run, whose file is a LevelDB log of blocks and pieces."""
    from wandb.proto import wandb_internal_pb2

    messages: Any = wandb_internal_pb2
    content, place, record = path.read_bytes(), FILE_HEADER, b""
    while place + HEADER <= len(content):
        left = BLOCK - place % BLOCK
        if left < HEADER:  # padding at the end of the block
            place += left
            continue
        _, size, kind = struct.unpack_from("<IHB", content, place)
        place += HEADER + size
        if kind not in PIECES or place > len(content):
            return
        record += content[place - size : place]
        if kind in LAST_PIECES:
            yield messages.Record.FromString(record)
            record = b""


def _note(generations: int, digest: str = "") -> dict[str, Any]:
    return {"generations": generations, "digest": digest}


def _read_note(path: Path) -> dict[str, Any]:
    """Read the note of an offline run; it has -1 generations if the run is incomplete."""
    try:
        note = json.loads((path / NOTE).read_text(encoding="utf-8"))
        return _note(int(note["generations"]), str(note["digest"]))
    except (OSError, ValueError, TypeError, KeyError):
        return _note(-1)

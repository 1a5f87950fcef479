"""An observer that writes event files for TensorBoard."""

import struct
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from evoros.base.checks import TEXT, checked
from evoros.base.errors import require_extra
from evoros.files.resources import expand_home
from evoros.observers.protocol import ObservedEnd, ObservedRun, Observer, Send

DIGEST, CONFIGURATION = "evoros/digest", "configuration"  # tags: digest of the run's end, values
SHOWN_BYTES = 100_000  # maximum size [bytes] of a champion file to display


@dataclass(frozen=True)
@checked
class Tensorboard(Observer):
    """An observer that writes event files to ``folder``, in a subfolder per run, by sweep."""

    folder: Annotated[str, TEXT] = "outputs/tensorboard"

    def check(self) -> None:
        """Check that the package for writing event files is installed."""
        with require_extra("tensorboard", "observers=tensorboard"):
            import tensorboardX  # noqa: F401

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        """Open the run's folder, and read event files of earlier sessions."""
        self.check()
        place = run.origin / expand_home(self.folder) / (run.group or "")
        with closing(_Events(place / f"{run.name}_{run.id[:8]}")) as events:
            yield events.send


class _Events:
    """The event files of one run; each session creates a file when it first writes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scalars: dict[str, set[int]] = {}
        self.texts: dict[str, str] = {}
        self._writer: Any = None
        files = sorted(folder.glob("events.out.tfevents.*"))
        self._files = len(files)
        for file in files:
            self._read(file)

    def _read(self, file: Path) -> None:
        from tensorboardX.proto.event_pb2 import Event

        for record in _read_records(file.read_bytes()):
            event = Event.FromString(record)
            for value in event.summary.value:
                if value.HasField("simple_value"):
                    self.scalars.setdefault(value.tag, set()).add(event.step)
                elif value.tensor.string_val:
                    tag = value.tag.removesuffix("/text_summary")
                    self.texts[tag] = value.tensor.string_val[0].decode()

    @property
    def writer(self) -> Any:
        if self._writer is None:
            from tensorboardX import SummaryWriter

            # distinguishes files created within the same second
            suffix = f".{self._files:05d}"
            self._writer = SummaryWriter(str(self.folder), filename_suffix=suffix)
        return self._writer

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()

    def send(self, run: ObservedRun) -> None:
        if CONFIGURATION not in self.texts:
            rows = (f"| {key} | {value} |" for key, value in run.parameters.items())
            table = "\n".join(["| key | value |", "|---|---|", *rows])
            self._write_text(CONFIGURATION, table, 0, run.started_s)
            self._write_parameters(run)
        for generation in run.generations:
            self._write_scalars(generation.metrics, generation.number, generation.time_s)
        if run.end is not None and self.texts.get(DIGEST) != run.end.digest:
            self._write_end(run.end, len(run.generations))
        if self._writer is not None:
            self._writer.flush()

    def _write_scalars(self, metrics: Mapping[str, float], step: int, time_s: float) -> None:
        for name, value in metrics.items():
            steps = self.scalars.setdefault(name, set())
            if step not in steps:
                self.writer.add_scalar(name, value, step, walltime=time_s)
                steps.add(step)

    def _write_text(self, tag: str, text: str, step: int, time_s: float) -> None:
        if self.texts.get(tag) != text:
            self.writer.add_text(tag, text, step, walltime=time_s)
            self.texts[tag] = text

    def _write_parameters(self, run: ObservedRun) -> None:
        from tensorboardX.summary import hparams

        values = {key: str(v) if v is None else v for key, v in run.parameters.items()}
        for summary in hparams(values, {"best_fitness": 0.0}):
            self.writer.file_writer.add_summary(summary, 0, run.started_s)

    def _write_end(self, end: ObservedEnd, step: int) -> None:
        self._write_scalars(end.metrics, step, end.time_s)
        for name, content in end.files.items():
            if name.endswith((".csv", ".json")) and len(content) <= SHOWN_BYTES:
                text = f"```\n{content.decode(errors='replace')}\n```"
                self._write_text(name, text, step, end.time_s)
        self._write_text(DIGEST, end.digest, step, end.time_s)


def _read_records(content: bytes) -> Iterator[bytes]:
    """Yield the complete records of an event file (length, checksum, content, checksum)."""
    place = 0
    while place + 12 <= len(content):
        (length,) = struct.unpack_from("<Q", content, place)
        end = place + 12 + length
        if end + 4 > len(content):
            return
        yield content[place + 12 : end]
        place = end + 4

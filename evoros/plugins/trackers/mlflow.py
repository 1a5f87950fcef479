"""An observer that sends runs to an MLflow server or database file."""

import fcntl
import hashlib
import logging
import os
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Annotated, Any

from evoros.base.checks import TEXT, checked
from evoros.base.errors import require_extra
from evoros.files.resources import expand_home
from evoros.observers.protocol import ObservedEnd, ObservedRun, Observer, Send

RUN, SWEEP, DIGEST = "evoros.run", "evoros.sweep", "evoros.digest"
"""Tags: id of a run, hash of a sweep's folder, and digest of a run's end once sent."""
DEFAULTS = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
    # otherwise, an unresponsive server would delay the run for minutes
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
}
"""Default values of environment variables."""
STATUS = {"finished": "FINISHED", "stopped": "FAILED", "killed": "KILLED"}
RUNNING = "RUNNING"
SQLITE, FILE = "sqlite:///", "outputs/mlflow.db"
MOST_PARAMETERS, LONGEST = 100, 6000  # MLflow's limits: parameters per request, characters each
_LOCK = Lock()  # jobs of a sweep run in threads, and share experiments and parent runs


@dataclass(frozen=True)
@checked
class Mlflow(Observer):
    """Sends runs to ``tracking_uri``, MLFLOW_TRACKING_URI or ``outputs/mlflow.db`` of MLflow."""

    tracking_uri: Annotated[str | None, TEXT] = None
    experiment: Annotated[str, TEXT] = "evoros"

    def check(self) -> None:
        """Require MLflow's client package."""
        for name, value in DEFAULTS.items():
            os.environ.setdefault(name, value)
        with require_extra("mlflow", "observers=mlflow"):
            import mlflow  # noqa: F401
        for library in ("mlflow", "alembic"):  # both log the creation of a database
            logging.getLogger(library).setLevel(logging.WARNING)

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        """Connect to the server or database."""
        self.check()
        from mlflow import MlflowClient

        uri = self.tracking_uri or os.environ.get("MLFLOW_TRACKING_URI") or SQLITE + FILE
        artifacts = None
        if uri.startswith(SQLITE):
            file = run.origin / expand_home(uri.removeprefix(SQLITE))
            file.parent.mkdir(parents=True, exist_ok=True)
            uri, artifacts = f"{SQLITE}{file.absolute()}", (file.parent / "mlartifacts").absolute()
        place = None if artifacts is None else artifacts.as_uri()
        database = None if artifacts is None else artifacts.parent
        with _LOCK, _lock_folder(database), require_extra("mlflow", "observers=mlflow"):
            client = MlflowClient(tracking_uri=uri)
            experiment = self._find_experiment(client, place)
        yield _Connection(client, experiment).send

    def _find_experiment(self, client: Any, place: str | None) -> str:
        found = client.get_experiment_by_name(self.experiment)
        if found is None:
            try:
                return str(client.create_experiment(self.experiment, place))
            except Exception:
                found = client.get_experiment_by_name(self.experiment)
                if found is None:  # another process was faster
                    raise
        return str(found.experiment_id)


@contextmanager
def _lock_folder(folder: Path | None) -> Iterator[None]:
    """Keep other processes, such as jobs of a launcher, from creating the same database."""
    if folder is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some file systems do not support locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


class _Connection:
    def __init__(self, client: Any, experiment: str) -> None:
        self.client, self.experiment = client, experiment
        self.id = ""  # MLflow's run id
        self.status = self.digest = ""
        self.parameters: dict[str, str] = {}
        self.steps: dict[str, set[int]] = {}

    def send(self, run: ObservedRun) -> None:
        if not self.id:
            self._begin(run)
        if run.end is None:
            self._set_status(RUNNING)
        self._send_parameters(run)
        for generation in run.generations:
            self._send_metrics(generation.metrics, generation.number, generation.time_s)
        if run.end is not None:
            if run.end.digest != self.digest:
                self._send_end(run.end, len(run.generations))
            self._set_status(STATUS[run.end.state], run.end.time_s)

    def _begin(self, run: ObservedRun) -> None:
        with _LOCK:
            tags = {}
            if run.sweep is not None:
                key = hashlib.sha256(run.sweep.encode()).hexdigest()
                parent = self._find_or_create(SWEEP, key, str(run.group), time.time(), {})
                if parent.info.status == RUNNING:  # the parent run only groups runs
                    self.client.set_terminated(parent.info.run_id)
                tags["mlflow.parentRunId"] = parent.info.run_id
            found = self._find_or_create(RUN, run.id, run.name, run.started_s, tags)
        self.id, self.status = found.info.run_id, found.info.status
        self.digest = found.data.tags.get(DIGEST, "")
        self.parameters = {k: found.data.tags.get(k, v) for k, v in found.data.params.items()}
        for name in found.data.metrics:
            history = self.client.get_metric_history(self.id, name)
            self.steps[name] = {metric.step for metric in history}

    def _find_or_create(
        self, tag: str, value: str, name: str, started_s: float, tags: Mapping[str, str]
    ) -> Any:
        runs = self._find(tag, value)
        if runs:
            return runs[0]
        described = _to_ms(started_s), {**tags, tag: value}
        made = self.client.create_run(self.experiment, *described, run_name=name)
        first = self._find(tag, value)[0]
        if first.info.run_id != made.info.run_id:  # another process was faster
            self.client.delete_run(made.info.run_id)
        return first

    def _find(self, tag: str, value: str) -> list[Any]:
        runs = self.client.search_runs([self.experiment], f"tags.`{tag}` = '{value}'")
        return sorted(runs, key=lambda run: (run.info.start_time, run.info.run_id))

    def _set_status(self, status: str, ended_s: float | None = None) -> None:
        if status == self.status:
            return
        if ended_s is None:
            self.client.update_run(self.id, status)
        else:
            self.client.set_terminated(self.id, status, _to_ms(ended_s))
        self.status = status

    def _send_parameters(self, run: ObservedRun) -> None:
        """Send the parameters; a changed one becomes a tag, as MLflow keeps the first value."""
        from mlflow.entities import Param

        values = {_name(key): str(value)[:LONGEST] for key, value in run.parameters.items()}
        missing = [Param(key, v) for key, v in values.items() if key not in self.parameters]
        for begin in range(0, len(missing), MOST_PARAMETERS):
            self.client.log_batch(self.id, params=missing[begin : begin + MOST_PARAMETERS])
        for key, value in values.items():
            if self.parameters.get(key, value) != value:
                self.client.set_tag(self.id, key, value)
        self.parameters |= values

    def _send_metrics(self, metrics: Mapping[str, float], step: int, time_s: float) -> None:
        from mlflow.entities import Metric

        values = {_name(name): value for name, value in metrics.items()}
        missing = [name for name in values if step not in self.steps.get(name, ())]
        if missing:
            sent = [Metric(name, values[name], _to_ms(time_s), step) for name in missing]
            self.client.log_batch(self.id, metrics=sent)
        for name in missing:
            self.steps.setdefault(name, set()).add(step)

    def _send_end(self, end: ObservedEnd, step: int) -> None:
        self._send_metrics(end.metrics, step, end.time_s)
        with TemporaryDirectory() as folder:
            for name, content in end.files.items():
                file = Path(folder) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            if end.files:
                self.client.log_artifacts(self.id, folder)
        self.client.set_tag(self.id, DIGEST, end.digest)  # last, to mark the end as complete
        self.digest = end.digest


def _to_ms(seconds: float) -> int:
    return round(1000 * seconds)


def _name(name: str) -> str:
    return re.sub(r"[^\w./ -]", "_", name)

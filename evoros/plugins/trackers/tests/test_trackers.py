"""Each tracker stores all that it is sent once, and its own library can read it."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
import yaml
from fixture_types import Capture, Folders, Patch
from helpers import USER_PARTS, sweep, tiny

from evoros.cli.main import evoros
from evoros.observers.protocol import ObservedRun
from evoros.plugins.trackers.mlflow import Mlflow
from evoros.plugins.trackers.tensorboard import Tensorboard
from evoros.plugins.trackers.wandb import FOREIGN, Wandb, read_log
from evoros.storage.layout import hash_file
from evoros.terminal.console import DONE, STOPPED
from evoros.testing import ObserverSuite
from evoros.testing.observer import end, example_run

OWN = ("--config-dir", str(USER_PARTS))


@pytest.mark.parametrize("part", [Mlflow(), Tensorboard(), Wandb()])
def test_a_configuration_has_the_fields_and_defaults_of_its_class(part: Any) -> None:
    name = type(part).__name__.lower()
    folder = Path(__file__).parents[1] / "conf" / "observers"
    values = yaml.safe_load((folder / f"{name}.yaml").read_text())
    assert values[name].pop("_target_") == f"evoros.plugins.trackers.{name}.{type(part).__name__}"
    assert values == {name: vars(part)}


class TestTensorboard(ObserverSuite):
    part = Tensorboard()
    bad_values = ({"folder": ""}, {"folder": None})

    def read(self, run: ObservedRun) -> Any:
        (folder,) = (run.origin / "outputs" / "tensorboard").rglob(f"*_{run.id[:8]}")
        return read_events(folder)


def read_events(folder: Path) -> dict[str, list[tuple[Any, ...]]]:
    """The events that TensorBoard shows of a folder: steps and values by tag."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder))
    events.Reload()
    shown: dict[str, list[tuple[Any, ...]]] = {}
    for tag in events.Tags()["scalars"]:
        shown[tag] = [(event.step, event.value, event.wall_time) for event in events.Scalars(tag)]
    for tag in events.Tags()["tensors"]:
        tensors = events.Tensors(tag)
        shown[tag] = [(event.step, event.tensor_proto.string_val[0]) for event in tensors]
    return shown


def test_a_cut_event_file_is_continued(tmp_path: Path) -> None:
    suite = TestTensorboard()
    whole = end(example_run("cut", tmp_path, 3))
    shown = suite.send(whole)
    (file,) = tmp_path.rglob("events.*")
    content = file.read_bytes()
    for size in (0, 5, len(content) // 3, len(content) - 1):
        file.write_bytes(content[:size])
        for other in set(tmp_path.rglob("events.*")) - {file}:
            other.unlink()
        assert suite.send(whole) == shown, size


@pytest.fixture(scope="module")
def database(tmp_path_factory: Folders) -> Path:
    """A folder with a database, which MLflow needs seconds to make."""
    return tmp_path_factory.mktemp("mlflow")


def read_mlflow(origin: Path, run_id: str) -> dict[str, Any]:
    client, numbers = open_mlflow(origin)
    (found,) = client.search_runs(numbers, f"tags.`evoros.run` = '{run_id}'")
    mlflow_id = found.info.run_id
    history = {name: client.get_metric_history(mlflow_id, name) for name in found.data.metrics}
    files = list(list_files(client, mlflow_id))
    place = Path(found.info.artifact_uri.removeprefix("file://"))
    return {
        "status": found.info.status,
        "name": found.info.run_name,
        "started": found.info.start_time,
        "parameters": found.data.params,
        "changed": {k: v for k, v in found.data.tags.items() if k in found.data.params},
        "metrics": {n: [(m.step, m.value, m.timestamp) for m in h] for n, h in history.items()},
        "files": {name: hash_file(place / name) for name in files},
        "digest": found.data.tags.get("evoros.digest"),
        "parent": found.data.tags.get("mlflow.parentRunId"),
    }


def open_mlflow(origin: Path) -> tuple[Any, list[str]]:
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{origin}/outputs/mlflow.db")
    return client, [found.experiment_id for found in client.search_experiments()]


def list_files(client: Any, run_id: str, folder: str | None = None) -> Iterator[str]:
    for entry in client.list_artifacts(run_id, folder):
        if entry.is_dir:
            yield from list_files(client, run_id, entry.path)
        else:
            yield entry.path


@pytest.mark.slow
class TestMlflow(ObserverSuite):
    part = Mlflow()
    bad_values = ({"tracking_uri": ""}, {"experiment": " "})

    @pytest.fixture(autouse=True)
    def _share(self, database: Path) -> None:
        self.database = database

    def choose_origin(self, folder: Path) -> Path:
        return self.database

    def read(self, run: ObservedRun) -> Any:
        return read_mlflow(run.origin, run.id)

    def test_a_value_that_resuming_changes_is_a_tag(self) -> None:
        """MLflow keeps the first value of a parameter."""
        for seed, tags in ((3, {}), (4, {"seed": "4"}), (5, {"seed": "5"}), (3, {"seed": "3"})):
            run = example_run("resumed", self.database, 1)
            parameters = MappingProxyType({**run.parameters, "seed": seed})
            for _ in range(2):  # by two connections
                shown = self.send(replace(run, parameters=parameters))
                assert shown["parameters"]["seed"] == "3"
                assert shown["changed"] == tags


@pytest.mark.slow
class TestWandb(ObserverSuite):
    part = Wandb()
    bad_values = ({"project": ""}, {"folder": ""})

    def read(self, run: ObservedRun) -> Any:
        return read_wandb(run.origin, run.id)


@pytest.mark.slow
def test_variables_of_an_agent_do_not_join_runs(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr("sys.argv", ["evoros", "hydra.run.dir=caf\udce9"])  # Latin-1 as typed
    for name in FOREIGN:
        monkeypatch.setenv(name, "must" if name == "WANDB_RESUME" else "other")
    for name in ("one", "two"):
        assert TestWandb().send(end(example_run(name, tmp_path, 1)))


def read_wandb(origin: Path, run_id: str) -> dict[str, Any]:
    """Return the content of the only offline run with an id."""
    (folder,) = (origin / "outputs" / "wandb").glob(f"offline-run-*-{run_id}")
    history: list[list[tuple[str, str]]] = []
    summary: dict[str, str] = {}
    config, group = dict[str, str](), ""
    for record in read_log(folder / f"run-{run_id}.wandb"):
        kind = record.WhichOneof("record_type")
        if kind == "run":
            config = {entry.key: entry.value_json for entry in record.run.config.update}
            group = record.run.run_group
        elif kind == "history":
            row = {
                "/".join(item.nested_key) or item.key: item.value_json
                for item in record.history.item
            }
            timed = ("_timestamp", "_runtime")
            history.append(sorted((key, value) for key, value in row.items() if key not in timed))
        elif kind == "summary":
            summary |= {entry.key: entry.value_json for entry in record.summary.update if entry.key}
    files = [
        path for top in ("champion", "figures") for path in (folder / "files" / top).rglob("*.*")
    ]
    sent = ("state", "champion.")  # the library adds others, at times of its own
    return {
        "history": history,
        "summary": {key: value for key, value in summary.items() if key.startswith(sent)},
        "config": {key: value for key, value in config.items() if not key.startswith("_")},
        "group": group,
        "files": {path.name: hash_file(path) for path in files},
    }


@pytest.mark.slow
def test_a_sweep_is_nested_live_and_exported(
    database: Path, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(database)
    study = tmp_path / "study"
    assert sweep(study, "seed=0,1", "observers=[mlflow,tensorboard,wandb]") == DONE
    client, numbers = open_mlflow(database)
    (parent,) = client.search_runs(numbers, "attributes.run_name = 'study'")
    children = f"tags.`mlflow.parentRunId` = '{parent.info.run_id}'"
    runs = client.search_runs(numbers, children)
    assert sorted(run.data.params["seed"] for run in runs) == ["0", "1"]
    assert parent.info.status == "FINISHED"
    shown = [read_mlflow(database, run.data.tags["evoros.run"]) for run in runs]
    offline = [read_wandb(database, run.data.tags["evoros.run"]) for run in runs]
    for of_mlflow, of_wandb in zip(shown, offline, strict=True):
        assert of_wandb["group"] == "study"
        best = [value for _, value, _ in of_mlflow["metrics"]["best_fitness"]]
        assert best == [float(dict(row)["best_fitness"]) for row in of_wandb["history"]]
        (folder,) = (database / "outputs/tensorboard/study").glob(f"{of_mlflow['name']}_*")
        assert [value for _, value, _ in read_events(folder)["best_fitness"]] == pytest.approx(best)
    before = [(folder.name, folder.stat().st_mtime) for folder in database.rglob("*.*")]
    for name in ("mlflow", "tensorboard", "wandb"):
        assert evoros(["export", *OWN, name, str(study)]) == DONE
    assert [read_mlflow(database, run.data.tags["evoros.run"]) for run in runs] == shown
    assert len(client.search_runs(numbers, children)) == 2
    after = [(folder.name, folder.stat().st_mtime) for folder in database.rglob("*.*")]
    assert [entry for entry in after if ".db" not in entry[0]] == [
        entry for entry in before if ".db" not in entry[0]
    ]


@pytest.mark.slow
def test_a_server_that_is_not_there_costs_seconds(tmp_path: Path, capsys: Capture) -> None:
    nowhere = "tracking_uri=http://me:pw0rd@127.0.0.1:9"
    run, begun = tmp_path / "run", time.monotonic()
    assert tiny(run, "observers=mlflow", f"observers.mlflow.{nowhere}") == DONE
    assert time.monotonic() - begun < 200  # mlflow itself would try for longer
    (warning,) = [line for line in capsys.readouterr().err.splitlines() if "observers" in line]
    assert "the run continues without this observer" in warning
    key, _, value = nowhere.partition("=")
    assert f"evoros export mlflow {run} '{key}=\"{value}\"'" in warning
    assert evoros(["export", "mlflow", nowhere, str(run)]) == STOPPED
    assert "pw0rd" not in capsys.readouterr().err

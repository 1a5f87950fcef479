"""An archive is an RO-Crate by the judgement of others: a validator, and a reader of runs."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from helpers import USER_PARTS, finished_run

from evoros.plugins.archives.archive import archive
from evoros.terminal.console import DONE

PROFILE = "process-run-crate-0.5"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive of two runs, of which one has a name with a space."""
    folder = tmp_path_factory.mktemp("study")
    for name in ("first", "second run"):
        finished_run(folder / "study" / name)
    given = [str(folder / "study"), "--output", str(folder / "study.zip"), "--license", "CC0-1.0"]
    assert archive([*given, "--config-dir", str(USER_PARTS), "--author", "A Name"]) == DONE
    return folder / "study.zip"


def load_context() -> Any:
    """Load the context of RO-Crates that the package rocrate has; the validator would fetch it."""
    import rocrate

    return json.loads(Path(rocrate.__file__).with_name("data").joinpath(FILE).read_text())


FILE = "ro-crate.jsonld"


@pytest.mark.slow
def test_a_validator_finds_nothing_that_is_required(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recommended entries need facts that evoros does not have: a publisher, affiliations."""
    from rocrate_validator import models, services
    from rocrate_validator.utils import document_loader, http

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    context = load_context()
    headers = {"Content-Type": "application/ld+json"}
    answer = SimpleNamespace(status_code=200, json=lambda: context, headers=headers)
    monkeypatch.setattr(http.HttpRequester, "get", lambda *_, **__: answer, raising=False)
    monkeypatch.setattr(document_loader, "_fetch_json_ld", lambda url: context)
    settings = services.ValidationSettings(
        rocrate_uri=study,
        profile_identifier=PROFILE,
        requirement_severity=models.Severity.REQUIRED,
        offline=True,
    )
    result = services.validate(settings)
    assert [issue.message for issue in result.get_issues()] == []
    assert result.passed()


@pytest.mark.slow
def test_a_reader_of_runs_finds_each_run(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from runcrate.report import dump_crate_actions

    dump_crate_actions(study)
    said = capsys.readouterr().out
    assert said.count("instrument: #evoros (SoftwareApplication)") == 2
    assert said.count("/config.yaml") == 2
    assert said.count("/missions.csv") == 2

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest
from fixture_types import Capture, Patch
from helpers import TINY, content, everything, finished_run, resume, tiny
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.config.compose import compose, compose_with_hydra, list_choices
from evoros.config.configuration import Configuration, freeze
from evoros.config.jobs import Job, Jobs
from evoros.config.recorded import flatten, read_recorded
from evoros.config.references import register_resolver
from evoros.storage.run_key import hash_secrets, list_other_secrets
from evoros.terminal.console import DONE, INPUT

EXPERIMENTS = ("as_run", "quickstart", "benchmark_network", "two_rovers", "barn")
SLOW = "failure.latest_s='${oc.decode:${oc.env:NAME}}'"


@pytest.mark.parametrize("experiment", [e for e in EXPERIMENTS if e in list_choices("experiment")])
def test_every_key_is_recorded_alike_typed_plainly_and_by_reference(
    experiment: str, monkeypatch: Patch
) -> None:
    plain = compose([f"experiment={experiment}"])
    config = compose_with_hydra([f"experiment={experiment}"])
    referring = 0
    for key, value in flatten(plain).items():
        if value == "???" or (isinstance(value, str) and "${" in value):
            continue
        if key.startswith("observers."):  # texts that leave evoros are hashed
            continue
        name = f"PLAIN_{referring}"
        monkeypatch.setenv(name, "null" if value is None else str(value))
        text = isinstance(value, str)
        read = f"${{oc.env:{name}}}" if text else f"${{oc.decode:${{oc.env:{name}}}}}"
        OmegaConf.update(config, key, read, force_add=True)
        referring += 1
    assert referring > 50
    recorded = freeze(config)
    assert recorded.text == plain.text
    assert recorded.values == plain.values


@given(st.text(st.sampled_from("a$\\{}:.'\" é"), max_size=12))
def test_any_text_of_a_variable_is_read_again_as_it_is(text: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PLAIN", text)
        config = freeze(OmegaConf.create({"name": "${oc.env:PLAIN}", "copy": "${name}"}))
    again = OmegaConf.to_container(OmegaConf.create(config.text), resolve=True)
    assert again == config.values == {"name": text, "copy": text}


def test_a_resolver_is_called_once() -> None:
    register_resolver("draw", random.random)
    tree = {"a": "x ${b}", "b": "${draw:}", "c": ["${b}", "${draw:}"], "d": "${oc.select:b}"}
    config = freeze(OmegaConf.create(tree))
    assert config.values == OmegaConf.to_container(OmegaConf.create(config.text), resolve=True)
    b = config.values["b"]
    assert (config.values["a"], config.values["c"][0], config.values["d"]) == (f"x {b}", b, b)


@pytest.mark.parametrize("at", ["a", "a.0", "a.0.b", "a.1.0"])
def test_a_key_without_a_value_is_named_once(at: str) -> None:
    trees = {"a": "X", "a.0": ["X"], "a.0.b": [{"b": "X"}], "a.1.0": [1, ["X"]]}
    tree = json.loads(json.dumps({"a": trees[at]}).replace("X", "${oc.env:NOWHERE_SET}"))
    with pytest.raises(InputError, match=rf"^{re.escape(at)}|^a\[") as refused:
        freeze(OmegaConf.create(tree))
    assert len(re.findall(r"(?<!\w)a(?:[.[]|: )", str(refused.value))) == 1


@pytest.mark.parametrize("source", ["like", "designs"])
def test_the_designs_of_an_evaluation_may_be_named_by_reference(
    source: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    finished_run(tmp_path / "run", "optimizer.generations=1")
    monkeypatch.setenv("WHERE", str(tmp_path / "run"))
    for name, value in (("plain", str(tmp_path / "run")), ("by_reference", "'${oc.env:WHERE}'")):
        typed = ["evaluate", *TINY, "executor=serial", f"{source}={value}", "trials=1"]
        typed = [word for word in typed if source == "designs" or word != "experiment=tiny"]
        assert evoros([*typed, f"hydra.run.dir={tmp_path / name}"]) == DONE
    plain, other = (
        {file: (tmp_path / name / file).read_bytes() for file in ("designs.csv", "config.yaml")}
        for name in ("plain", "by_reference")
    )
    assert other == plain


SECRET_TREES: dict[str, dict[str, Any]] = {
    "name of the variable": {"a": "${oc.env:API_KEY}"},
    "name found by a variable": {"a": "${oc.env:${oc.env:WHICH}}"},
    "default": {"a": "${oc.env:API_KEY,none}"},
    "key": {"a": {"password": "${oc.env:PLAIN}"}},
    "environment of a program": {"controller": {"environment": {"a": "${oc.env:PLAIN}"}}},
    "words of a program": {"controller": {"command": ["run", "${oc.env:PLAIN}"]}},
    "address": {"a": "tcp://me:${oc.env:PLAIN}@host"},
    "resolver of others": {"a": "${vault:password}"},
    "part of a text": {"a": "x${b}", "b": "${oc.env:API_KEY}"},
    "default of another": {"a": "${oc.select:b,none}", "b": "${oc.env:API_KEY}"},
    "inside what another gives": {"a": "${oc.dict.values:b}", "b": {"c": "${oc.env:API_KEY}"}},
}


@pytest.mark.parametrize("tree", SECRET_TREES.values(), ids=SECRET_TREES)
def test_a_secret_is_hashed_and_not_recorded(tree: dict[str, Any], monkeypatch: Patch) -> None:
    def read(secret: str) -> tuple[Configuration, dict[str, str]]:
        for name, value in {"API_KEY": secret, "PLAIN": secret, "WHICH": "API_KEY"}.items():
            monkeypatch.setenv(name, value)
        register_resolver("vault", lambda _: secret)
        config = freeze(OmegaConf.create(tree))
        assert secret in str(config.values)
        assert secret not in config.text
        return config, hash_secrets(config.values, config.text)

    one, same, other = map(read, ("s3cr3t", "s3cr3t", "0th3r"))
    assert one == same
    assert list_other_secrets(one[1], other[1]) == list(one[1])
    assert one[1]
    assert not any(secret in str(one[1]) for secret in ("s3cr3t", "0th3r"))


@pytest.mark.slow
def test_a_run_by_reference_is_the_run_that_is_typed(tmp_path: Path, monkeypatch: Patch) -> None:
    short = ("optimizer.generations=1",)
    for value in ("2.5", "4.5"):
        assert (
            tiny(tmp_path / f"typed_{value}", f"failure.latest_s={value}", "seed=3", *short) == DONE
        )
        monkeypatch.setenv("LATEST", value)
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "3")
        seed = "seed='${oc.decode:${oc.env:SLURM_ARRAY_TASK_ID}}'"
        referring = (SLOW.replace("NAME", "LATEST"), seed, "+treatment.at='${now:%H%M%S%f}'")
        run = tmp_path / f"by_reference_{value}"
        assert tiny(run, *referring[:2], *short) == DONE
        assert content(run) == content(tmp_path / f"typed_{value}")
        assert tiny(tmp_path / f"at_{value}", *referring, *short) == DONE
    study = load_study([tmp_path])
    assert len(study.records) == 4
    assert len({record.levels["latest_s"] for record in study.records}) == 2
    monkeypatch.delenv("LATEST")
    monkeypatch.delenv("SLURM_ARRAY_TASK_ID")
    for run in sorted(tmp_path.glob("*_4.5")):
        before = content(run)
        assert resume(run) == DONE
        assert content(run) == before


@pytest.mark.slow
def test_runs_of_other_secrets_are_neither_pooled_nor_resumed(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    for run, secret in (("one", "3.2468135"), ("two", "4.2468135"), ("again", "3.2468135")):
        monkeypatch.setenv("MY_SECRET", secret)
        latest = SLOW.replace("NAME", "MY_SECRET")
        seed = f"seed={len(run)}"
        assert tiny(tmp_path / run, latest, seed, "optimizer.generations=1") == DONE
        assert not any(secret.encode() in data for data in everything(tmp_path / run).values())
    treatments = {record.name: record.treatment for record in load_study([tmp_path]).records}
    assert treatments["one"] == treatments["again"] != treatments["two"]
    assert resume(tmp_path / "one") == DONE
    capsys.readouterr()
    assert resume(tmp_path / "two") == INPUT
    assert "configuration (failure.latest_s) has changed since" in capsys.readouterr().err
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "of_somebody_else"))
    assert (
        read_recorded(tmp_path / "one" / "config.yaml").values["failure"]["latest_s"] == 3.2468135
    )
    assert resume(tmp_path / "one") == DONE  # another user cannot compare the secret


def test_jobs_of_a_sweep_have_values_by_their_own_numbers() -> None:
    typed = ["trials=1,2", "failure=random", "failure.latest_s='${oc.decode:${trials}.5}'"]
    jobs = [job for job in Jobs(typed, True, None) if isinstance(job, Job)]
    assert [job.config.values["failure"]["latest_s"] for job in jobs] == [1.5, 2.5]
    assert all("latest_s: ${" not in job.config.text for job in jobs)

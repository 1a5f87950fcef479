"""The examples of docs/requirements.md run, and its table is what the benchmark prints."""

import re
from pathlib import Path
from runpy import run_path

import pytest
from documents import text
from helpers import TINY, USER_PARTS

import evoros.api
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

PAGE = text("requirements")
DESIGN = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


def test_the_file_of_claims_is_used_as_it_is(tmp_path: Path) -> None:
    claims = "".join(blocks("yaml"))
    (tmp_path / "mine" / "requirements").mkdir(parents=True)
    (tmp_path / "mine" / "requirements" / "mine.yaml").write_text(claims)
    (tmp_path / "one.csv").write_text(DESIGN)
    parts = ["simulator=planar", "world=blocks", "course.time_limit_s=5", "executor=serial"]
    claimed = ("requirements=mine", "trials=2", "figures=[]")
    typed = [*parts, f"designs={tmp_path / 'one.csv'}", *claimed]
    folder = ("--config-dir", str(tmp_path / "mine"), f"hydra.run.dir={tmp_path / 'tested'}")
    assert evaluate([*folder, *typed]) in (DONE, NOT_MET, NOT_DECIDED)
    summary = (tmp_path / "tested" / "requirements.md").read_text()
    for name in re.findall(r"^(\w+):$", claims, re.M):
        assert f"| {name}: " in summary


def test_a_typed_claim_is_one_argument(tmp_path: Path) -> None:
    (claim,) = re.findall(r"`'(\+requirements\.[^`]*)'`", PAGE)
    (tmp_path / "one.csv").write_text(DESIGN)
    places = [f"designs={tmp_path / 'one.csv'}", f"hydra.run.dir={tmp_path / 'tested'}"]
    evaluate([*TINY, "executor=serial", *places, claim])
    assert "| soon: " in (tmp_path / "tested" / "requirements.md").read_text()


@pytest.mark.slow
def test_the_test_of_a_project_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def quicker(overrides: list[str], config_dir: object) -> object:
        return compose(["experiment=tiny", "executor=serial", *overrides], config_dir=USER_PARTS)

    monkeypatch.setattr(evoros.api, "_compose", quicker)
    (block,) = blocks("python")
    made: dict[str, object] = {}
    exec(block, made)
    test = made["test_the_rover_delivers"]
    assert callable(test)
    with pytest.raises(AssertionError, match=r"design 0 undecided: .* 50(\.0)? % in 100 trials "):
        test()  # the limit itself: of the two worlds, the robot completes the near one always


@pytest.mark.slow
def test_rows_of_the_table_are_those_of_the_benchmark() -> None:
    """The cheap ones; the others take thousands of trials."""
    script = run_path(str(Path(__file__).parents[2] / "benchmarks/requirements/sequential.py"))
    rows = re.findall(r"^\| (0\.\d+) \| (\d\.\d+) \| (.*) \| (\d+) \| (\d*) ?\|$", PAGE, re.M)
    assert len(rows) == sum(map(len, script["LIMITS"].values()))
    for limit, share, chances, trials, fixed in rows:
        if int(trials) < 30:
            met, violated, mean = script["decide"](float(share), float(limit))
            expected = (met, violated, 1 - met - violated)
            assert chances.split(" | ") == [f"{abs(chance):.3f}" for chance in expected]
            assert trials == f"{mean:.0f}"
            assert int(fixed) == script["count_fixed"](float(share), float(limit))

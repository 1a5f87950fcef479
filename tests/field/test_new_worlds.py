"""Generated worlds in missions and runs, and the command that writes one."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from field_cases import course, field, noted
from fixture_types import Capture, Patch
from helpers import USER_PARTS, content, tiny

from evoros.base.errors import InputError
from evoros.cli.world import world
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.field.generated import generate_world
from evoros.mission.plan import Plan
from evoros.session.replay import replay
from evoros.storage.reading import load_run
from evoros.world.loading import load_world
from evoros.world.model import World


def values(**changes: Any) -> dict[str, Any]:
    one = field(**changes)
    return {name: value for name, value in vars(one).items() if name != "others"}


def renewed() -> World:
    return generate_world(**values(density=0.1), renew=True)


def test_missions_that_share_their_draws_meet_the_same_world_and_others_do_not() -> None:
    plan, design = Plan(0, ("generated",), 2, 2, "generation"), Design(())
    world = renewed()

    def met(missions: Any) -> list[str]:
        return [world.at(mission.draws).source_sha256 for mission in missions]

    first, second = met(plan.selection(3, 1, design)), met(plan.selection(3, 2, design))
    assert first == second
    assert len(set(first)) == 2  # another one in each trial
    validated = met(plan.validation(3, 1, design))
    assert met(plan.validation(9, 8, design)) == validated
    fresh = met(plan.evaluation(0, 1, design))
    others = [*met(plan.selection(4, 1, design)), *validated, *fresh]
    assert len({*first, *others}) == len(first) + len(others)


def test_a_world_that_is_not_renewed_is_the_same_in_every_mission() -> None:
    world = generate_world(**values())
    assert world.at("a") is world.at("b") is world
    assert renewed().bodies == renewed().bodies  # the example that a renewed one is itself
    with pytest.raises(InputError, match="renew"):
        generate_world(**values(), renew="yes")  # type: ignore[arg-type]


# ---- The command.


def test_the_command_writes_what_the_configuration_describes(tmp_path: Path) -> None:
    path = tmp_path / "field.sdf"
    assert world([str(path), "world.generated.seed=3"]) == 0
    experiment = compose(["world=generated", "world.generated.seed=3"]).build()
    assert path.read_text() == experiment.world["generated"].sdf
    bodies = load_world(str(path), course()).bodies
    assert bodies == experiment.world["generated"].bodies


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["there.sdf"], "already exists"),
        (["new.sdf", "world=case_study"], "must be one world, not 3"),
        (["new.sdf", "world.generated.densty=1"], "did you mean world.generated.density"),
        (["nowhere/new.sdf"], "cannot be written"),
        (["seed=1"], "must be the name of a new file"),
    ],
)
def test_the_command_says_what_is_wrong(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.sdf").write_text("mine")
    assert world(arguments) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "there.sdf").read_text() == "mine"
    assert not (tmp_path / "new.sdf").exists()


@pytest.mark.slow
def test_the_champion_keeps_the_worlds_that_it_met(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    small = ["world.generated.density=0.1", "world.generated.course.time_limit_s=10"]
    for place, executor in ((here, "serial"), (there, "processes")):
        renewal = ["world=generated", "world.generated.renew=true", f"executor={executor}"]
        assert tiny(place, *renewal, *small) == 0
    assert content(here) == content(there)
    run = load_run(here)
    champion = int(pd.read_csv(here / "champion" / "design.csv").design.iloc[0])
    rows = run.missions[(run.missions.design == champion) & (run.missions.purpose == "selection")]
    kept = (here / "champion" / "world_generated.sdf").read_text()
    made, draws = noted(kept)
    assert draws == rows.draws.iloc[0]
    assert made.draw_world(draws).sdf == kept
    assert run.missions.draws.nunique() == 4  # three generations and the validation
    row = rows.iloc[0]
    key = int(row.generation), champion, row.world, int(row.trial)
    (outcome,), track = replay(here, key, config_dir=USER_PARTS)
    assert outcome.time_s == row.time_s
    assert len(track) == len(run.trajectory("generated"))

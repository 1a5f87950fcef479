"""Missions among walkers: the same bits again and compiled or not, draws, records, refusals."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mission_cases import run_interpreted

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import COLLISION, Mission
from evoros.mission.rollout import run_mission
from evoros.preflight.scene import check_room
from evoros.storage.tables import (
    MISSION_COLUMNS,
    OUTCOME_COLUMNS,
    TOUCHED,
    are_recorded,
    mission_row,
    name_outcome_columns,
    read_outcomes,
    to_csv,
)

BASE = ["world=boxes", "course.time_limit_s=30", "executor=serial", "walkers=people"]
INTO = [
    "walkers.people.number=1", "walkers.people.route=[[0,1],[0,-2]]", "walkers.people.phase=even",
    "walkers.people.avoids_robots=false", "walkers.people.pace_mps=2.0",
]  # fmt: skip
"""Somebody who walks from the left into the robot at home."""


def build(*overrides: str) -> Experiment:
    return compose([*BASE, *overrides]).build()


def first_mission(experiment: Experiment) -> Mission:
    design = experiment.space.decode(np.full(experiment.space.size, 0.4))
    return experiment.plan.evaluation(0, 0, design)[0]


def run(experiment: Experiment, *more: Any) -> tuple[Any, Array]:
    return run_mission(experiment.scenario, first_mission(experiment), *more)


def select(experiment: Experiment, track: Array, ending: str) -> Array:
    mission = first_mission(experiment)
    names = experiment.scenario.name_columns(mission.design, mission.world)
    columns = [i for i, name in enumerate(names) if name.startswith("walkers.") and ending in name]
    return track[:, columns]


def test_a_mission_has_the_same_bits_again_and_interpreted() -> None:
    experiment = build("walkers.people.stops_for_robots=true", "course.time_limit_s=12")
    first, again = run(experiment), run(experiment)
    stepped = run(experiment, run_interpreted)
    for outcomes, track in (again, stepped):
        assert repr(outcomes) == repr(first[0])
        assert track.tobytes() == first[1].tobytes()
    assert np.ptp(select(experiment, first[1], "x_m"), axis=0).max() > 3.0


def test_who_touched_the_robot_is_recorded() -> None:
    experiment = build(*INTO)
    (outcome,), track = run(experiment)
    assert outcome.ended == COLLISION
    assert outcome.touched_walkers == ("people_0",)
    touched = select(experiment, track, "touched_by")[:, 0]
    assert touched[-1] == 1.0
    assert not touched[:-1].any()
    mission = first_mission(experiment)
    columns = [*MISSION_COLUMNS, *name_outcome_columns([], [TOUCHED])]
    text = to_csv([mission_row(mission, (outcome,), further=[TOUCHED])]).strip().split(",")
    read = read_outcomes(dict(zip(columns, text, strict=True)))
    assert read[0].touched_walkers == outcome.touched_walkers
    assert are_recorded((outcome,), read, [])


def test_a_collision_with_an_obstacle_names_nobody() -> None:
    """The walker is far away."""
    far = ["walkers.people.route=[[-9,-9],[-9,9]]", "walkers.people.number=1"]
    blind = ["controller/avoidance=blind", "course.time_limit_s=540"]
    (outcome,), _ = run(build(*far, *blind))
    assert outcome.ended == COLLISION
    assert outcome.touched_walkers == ()


def test_without_walkers_there_is_no_further_column() -> None:
    experiment = compose([*BASE[:-1]]).build()
    (outcome,), _ = run(experiment)
    assert outcome.touched_walkers is None
    assert not experiment.scenario.any_walkers
    assert [*OUTCOME_COLUMNS] == name_outcome_columns([])
    row = mission_row(first_mission(experiment), (outcome,))
    assert len(row) == len(MISSION_COLUMNS) + len(OUTCOME_COLUMNS)


def test_numbers_paces_and_routes_follow_the_draws_and_not_the_design() -> None:
    experiment = build("walkers.people.number=[1,4]", "course.time_limit_s=2")
    mission = first_mission(experiment)
    counts, tracks = set(), []
    for i in range(8):
        drawn = replace(mission, draws=f"draws {i}")
        _, track = run_mission(experiment.scenario, drawn)
        places = select(experiment, track, "x_m")
        counts.add(int(np.isfinite(places).all(axis=0).sum()))
        tracks.append(places[0].tobytes())
    assert counts <= {1, 2, 3, 4}
    assert len(counts) > 1
    assert len(set(tracks)) == 8
    other = experiment.space.decode(np.full(experiment.space.size, 0.6))
    _, track = run_mission(experiment.scenario, replace(mission, design=other, draws="draws 0"))
    assert select(experiment, track, "x_m")[0].tobytes() == tracks[0]


def test_another_group_leaves_the_draws_of_the_first_alone() -> None:
    more = "{_target_: evoros.walkers.crowd.Walkers, number: 1}"
    one, two = build("course.time_limit_s=1"), build("course.time_limit_s=1", f"+walkers.z={more}")
    places = [select(each, run(each)[1], "people") for each in (one, two)]
    assert places[0][0].tobytes() == places[1][0].tobytes()


WRONG: Sequence[tuple[list[str], str]] = [
    (["walkers.people.pace_mps=-1"], "walkers.people.pace_mps: must be a number greater than 0"),
    (["walkers.people.number=[5,2]"], "walkers.people.number: must be an integer from 0"),
    (["walkers.people.route=[[1,1]]"], "route: must be a list of at least two corners"),
    (["walkers.people.route=[[1,1],[1,1],[2,2]]"], "must have different consecutive corners"),
    (["walkers.people.route=[[-9,-2],[9,-2]]"], "walkers.people.route: each leg must be clear"),
    (["walkers.people.pace_mps=5", "walkers.people.radius_m=0.1"], "walkers.people.pace_mps"),
    (["world=generated", "world.generated.renew=true", "walkers.people.route=[[3,0],[3,9]]"],
     "walkers.people.route: must be null"),
    (["walkers.people.phase=even", "walkers.people.number=60",
      "walkers.people.route=[[0,1],[2,1]]"], "walkers.people.number: the world"),
    (["walkers.people.radius_m=2", "world=maze"], "lower this number or walkers.people.radius_m"),
    (["walkers.people.route=[[0.2,0],[-0.2,0]]"], "apart from each other and from the robots"),
]  # fmt: skip


@pytest.mark.parametrize(("overrides", "says"), WRONG)
def test_bad_input_is_one_line_before_the_run(overrides: list[str], says: str) -> None:
    with pytest.raises(InputError) as error:
        check_room(build(*overrides))
    assert says in str(error.value)
    assert "\n" not in str(error.value)
    assert "; " in str(error.value) or ", not " in str(error.value)


def test_the_stated_pace_is_the_fastest_that_is_allowed() -> None:
    thin = "walkers.people.radius_m=0.1"
    with pytest.raises(InputError, match=r"at most [\d.]+ m/s") as error:
        build("walkers.people.pace_mps=5", thin)
    (pace,) = map(float, re.findall(r"at most ([\d.]+) m/s", str(error.value)))
    build(f"walkers.people.pace_mps={pace}", thin)
    with pytest.raises(InputError, match=f"at most {pace:g} m/s"):
        build(f"walkers.people.pace_mps={1.05 * pace}", thin)

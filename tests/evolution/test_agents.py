"""Several robots in one experiment: their missions, their fitness, their files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import evoros
from evoros.base.errors import EvorosError, InputError
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.agent import Agent
from evoros.evolution.experiment import Experiment
from evoros.fitness.scoring import Scoring
from evoros.geometry.footprint import distances, project_bodies
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.preflight.preflight import preflight
from evoros.sensor.protocol import Mount
from evoros.terminal.console import DONE
from evoros.world.model import World

SHORT = ["experiment=two_rovers", "course.time_limit_s=60", "executor=serial", "trials=1"]
OWN_DESIGN = ["+design@agents.oncoming.design=six_sonars", "agents.oncoming.design.number=1"]
RUN = ["optimizer.population_size=3", "optimizer.generations=2", "figures=[]"]


def build(*overrides: str) -> Experiment:
    return compose([*SHORT, *overrides]).build()


def middle_mission(experiment: Experiment) -> Mission:
    design = experiment.space.decode(np.full(experiment.space.size, 0.4))
    return experiment.plan.evaluation(0, 0, design)[0]


@pytest.mark.slow
def test_a_robot_out_of_sight_changes_nothing_for_the_first() -> None:
    """The first robot's draws, readings and motion are those of its mission alone, to the bit."""
    together = build("agents.oncoming.home=[60,60,0]", "agents.oncoming.scored=false")
    alone = replace(together, agents={})
    outcomes, track = run_mission(together.scenario, middle_mission(together))
    own_outcomes, own_track = run_mission(alone.scenario, middle_mission(alone))
    assert repr(outcomes[:1]) == repr(own_outcomes)
    assert track[:, : own_track.shape[1]].tobytes() == own_track.tobytes()
    assert track.shape[1] == 2 * own_track.shape[1] - 1
    assert len(outcomes) == 2


@pytest.mark.parametrize("awaited", [True, False])
def test_a_mission_waits_for_the_robots_that_are_scored(awaited: bool) -> None:
    """The first one's route is complete at once, the other one's is not."""
    here = ["course.acceptance_m=8", "agents.oncoming.route=[[60,60]]"]
    experiment = build(*here, f"agents.oncoming.scored={str(awaited).lower()}")
    (outcome, other), track = run_mission(experiment.scenario, middle_mission(experiment))
    assert outcome.completed
    if awaited:
        assert other.ended in ("time_limit", "collision")
        assert other.time_s > outcome.time_s
    else:
        assert other.ended == "mission_over"
        assert other.time_s == outcome.time_s
    mission = middle_mission(experiment)
    columns = experiment.scenario.name_columns(mission.design, mission.world)
    table = pd.DataFrame(track, columns=columns)
    assert table["time_s"].iloc[-1] == max(outcome.time_s, other.time_s)
    ended = table[table["time_s"] > outcome.time_s + 1.0]
    assert ended[["x_m", "y_m"]].nunique().max() <= 1  # it stands where it stopped


TOWARDS = [
    "world=generated",
    "world.generated.density=0",
    "world.generated.enclosed=false",
    "course.home_yaw_rad=0",
    "course.waypoints=[[5,0]]",
    "course.direction=forward",
    "agents.oncoming.home=[3,0,3.14159265]",
    "agents.oncoming.route=[[-2,0]]",
    "controller/avoidance=blind",
    "controller/localization=exact",
    "controller.navigation.amplitude_deg=0",
    "~design.sensors.sonar.filters.noise",
]
"""Two rovers on empty ground, 3 m from each other, which see and do not avoid each other."""


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["planar", "mujoco", "pybullet"])
def test_robots_that_meet_in_a_mission_see_and_touch_each_other(simulator: str) -> None:
    """Each reads the distance of the other's front; both end where their fronts meet."""
    experiment = build(*TOWARDS, f"simulator={simulator}")
    front = Mount("sonar", "base_link", 0.25, 0.0, 0.166, 0.0, 12.5)
    design = Design((front,))
    mission = replace(middle_mission(experiment), design=design)
    outcomes, track = run_mission(experiment.scenario, mission)
    again = run_mission(experiment.scenario, mission)
    assert repr(outcomes) == repr(again[0])
    assert track.tobytes() == again[1].tobytes()
    columns = experiment.scenario.name_columns(design, mission.world)
    table = pd.DataFrame(track, columns=columns)
    outcome, other = outcomes
    assert outcome.ended == other.ended == "collision"
    assert outcome.time_s == other.time_s == table["time_s"].iloc[-1]
    gap = (table["oncoming.x_m"] - table["x_m"] - 2 * 0.25).to_numpy()
    assert gap[0] == pytest.approx(2.5, abs=0.01)
    assert abs(gap[-1]) < 0.02
    assert (gap[:-1] > 0.0).all()
    far = gap > 0.5  # nearer, each meets what the other has lower down
    for name in ("", "oncoming."):
        contact = table[f"{name}contact"]
        assert contact.iloc[-1] == 1.0
        assert contact.sum() == 1.0
        assert table[f"{name}range_0_m"][far].to_numpy() == pytest.approx(gap[far], abs=0.01)


DRAWN = ["world=generated", "world.generated.renew=true"]


def test_worlds_that_are_drawn_for_a_mission_leave_room_to_all_robots() -> None:
    experiment = build(*DRAWN, "agents.oncoming.home=[2,-3,0]", "agents.oncoming.route=[[-3,1]]")
    first, other = (
        experiment.scenario.place_worlds(member)["generated"] for member in experiment.members
    )
    places = np.array([[2.0, -3.0], [-3.0, 1.0], *first.course.waypoints])
    worlds = [first.at(f"{index}") for index in range(3)]
    for index, world in enumerate(worlds):
        assert other.at(f"{index}").bodies is world.bodies
        assert other.at(f"{index}").course == other.course != world.course
        areas = project_bodies(world.obstacles)
        assert min(distances(area, places).min() for area in areas) >= 1.0  # clearing_m
    assert len({world.source_sha256 for world in worlds}) == 3
    mission = middle_mission(experiment)
    (_, outcome), track = run_mission(experiment.scenario, mission)
    assert outcome.distance_m > 1.0
    start = 1 + track.shape[1] // 2
    assert track[0, start : start + 2] == pytest.approx([2.0, -3.0])


class Drawing:
    """A user's sampler that knows of one robot."""

    def draw_world(self, draws: str) -> World:
        raise NotImplementedError


def test_a_sampler_that_cannot_leave_room_to_others_is_refused() -> None:
    experiment = build()
    world = replace(experiment.world["blocks"], sampler=Drawing())
    with pytest.raises(InputError, match=r"world.blocks: the sampler Drawing lacks .* keep_free"):
        replace(experiment, world={"blocks": world})


def test_designs_of_their_own_are_genes_side_by_side() -> None:
    experiment = build(*OWN_DESIGN)
    space = experiment.space
    genes = [gene for block in space.blocks for gene in block.genes]
    assert sorted(genes) == list(range(space.size))
    genome = np.full(space.size, 0.5)
    before = space.decode(genome)
    assert len(before.mounts) == 6
    assert len(before.agents["oncoming"].mounts) == 2
    for block in space.blocks:
        for gene in block.genes:
            changed = genome.copy()
            changed[gene] = 0.03
            after = space.decode(changed)
            mine = block.name.startswith("oncoming.")
            assert (after.mounts == before.mounts) == mine
            assert (after.agents == before.agents) != mine
    assert {"sensor0_x_m", "oncoming.sensor0_x_m"} <= set(space.to_row(genome))
    with pytest.raises(InputError, match="genome"):
        space.decode(genome[:-1])


def test_neither_the_fitness_nor_stated_failures_concern_a_further_robot_by_default() -> None:
    member = Agent([1.0, 2.0, 0.0]).join("other", build().members[0])
    assert (member.scored, member.meets_cases) == (False, False)


def test_the_fitness_is_the_mean_over_the_robots_that_are_scored() -> None:
    experiment = build()
    outcomes, _ = run_mission(experiment.scenario, middle_mission(experiment))
    alone = experiment.fitness
    scores = [alone.score([outcome]) for outcome in outcomes]
    assert experiment.scoring.score_trial([outcomes]) == sum(scores) / 2
    assert "mean over the robots" in experiment.scoring.name.title
    only_first = build("agents.oncoming.scored=false").scoring
    assert only_first.score_trial([outcomes]) == scores[0]
    assert only_first.name == Scoring(alone).name
    lost = tuple(replace(outcome, ended="lost") for outcome in outcomes)
    assert experiment.scoring.score_trial([lost]) == alone.worst(lost[:1])


GENE = (
    "+agents.oncoming.design.genes.range={_target_: evoros.design.genes.Gene, "
    "key: controller.avoidance.range_m, low: 1, high: 4}"
)
BAD = [
    (["agents.oncoming.home=[0.3,0,0]"], r"agents.oncoming.home: must be clear of the first robot"),
    (["agents.oncoming.home=[1,2]"], r"home: must be three numbers"),
    (
        [*DRAWN, "agents.oncoming.home=[9,-3,0]"],
        r"world.generated, with agents oncoming: Field.extent_m: must reach at least clearing_m",
    ),
    (["+world.yard.course.home_x_m=1"], r"world.yard: some keys of the world are missing"),
    ([*OWN_DESIGN, "agents.oncoming.scored=false"], r"agents.oncoming.scored: must be true"),
    (["+robot@agents.oncoming.robot=mule"], r"agents.oncoming.design: must be set"),
    (
        [*OWN_DESIGN[:1], "agents.oncoming.design.number=0", GENE, "agents.oncoming.scored=false"],
        r"agents.oncoming.scored: must be true",
    ),
    (["simulator.time_step=0.03"], r"controller.period_s"),
    (["agents.oncoming=7"], r"agents: must be a mapping"),
    (["agents.oncoming.rout=[[1,1]]"], r"rout"),
]


@pytest.mark.parametrize(("overrides", "message"), BAD, ids=[case[1] for case in BAD])
def test_agents_that_do_not_fit_are_refused(overrides: list[str], message: str) -> None:
    with pytest.raises(EvorosError, match=message) as error:
        build(*overrides)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_a_warning_that_robots_share_is_given_once(caplog: pytest.LogCaptureFixture) -> None:
    """Both have a design that sees the ground; the far route is that of the agent alone."""
    preflight(build("robot.mount.pitch_deg=0", "agents.oncoming.route=[[0.1,0],[5,-5.2]]"))
    lines = [record.getMessage() for record in caplog.records]
    assert sum("sees the ground" in line for line in lines) == 1
    (warning,) = (line for line in lines if "counts as complete from the start" in line)
    assert warning.startswith("agents.oncoming.world.blocks: ")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("team") / "run"
    evoros.run(compose([*SHORT, *OWN_DESIGN, *RUN]), folder)
    return folder


def test_a_champion_of_a_team_can_be_read_scored_and_replayed(
    finished: Path, tmp_path: Path
) -> None:
    run = evoros.load_run(finished)
    designs = pd.read_csv(finished / "champion" / "design.csv")
    assert set(designs["agent"].dropna()) == {"oncoming"}
    assert len(designs) == 6 + 2
    assert (finished / "champion" / "agents" / "oncoming" / "robot.urdf").is_file()
    row = run.missions.iloc[0]
    key: Any = (row["generation"], row["design"], row["world"], row["trial"])
    (_, outcome), track = evoros.replay(finished, key)
    assert outcome.ended == row["oncoming.ended"]
    assert outcome.distance_m == row["oncoming.distance_m"]
    assert {"oncoming.x_m", "oncoming.mode"} <= set(track.columns)
    again = tmp_path / "again"
    places = [f"designs={finished}", f"hydra.run.dir={again}"]
    assert evaluate([*SHORT, *OWN_DESIGN, *places]) == DONE
    given = pd.read_csv(again / "designs_in.csv")
    assert given["x_m"].tolist() == designs["x_m"].tolist()
    assert given["agent"].fillna("").tolist() == designs["agent"].fillna("").tolist()
    assert len(pd.read_csv(again / "missions.csv")["oncoming.progress"].dropna()) == 1

"""Short missions of many parts, for tests that compare how they are run."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from evoros.compilation.rules import interpret_rule
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.batch import Batcher, NoKernel
from evoros.mission.compiled_loop import prepare
from evoros.mission.inputs import STAGES, Loop, LoopCall, LoopInputs, LoopResult, Run
from evoros.mission.loop import run_loop
from evoros.mission.mission import Mission
from evoros.mission.rollout import Rollout, run_mission

SHORT = ["simulator=planar", "course.time_limit_s=6"]
EARLY = ["failure.earliest_s=0", "failure.latest_s=4"]
COMBINATIONS = [
    ["failure=none", "controller=rover"],
    ["failure=random", "controller=rover", *EARLY],
    ["failure=spatial", "controller=rover_l1", *EARLY],
    ["failure=spatial", "filter@failure.effect=stuck", "controller/avoidance=blind", *EARLY],
    ["failure=random", "filter@failure.effect=dropout", *EARLY, "robot=erle_rover_as_run"],
    [
        "failure=random",
        "filter@failure.effect=bias",
        *EARLY,
        "+filter@design.sensors.sonar.filters.late=delay",
        "+filter@design.sensors.sonar.filters.held=hold",
        "+filter@controller.localization.noise=pose_noise",
    ],
]


@cache
def experiment_of(*overrides: str) -> Experiment:
    return compose([*SHORT, *overrides]).build()


def missions(experiment: Experiment, count: int) -> list[Mission]:
    """Those of so many random designs in all worlds."""
    rng = np.random.default_rng(len(repr(experiment.failure)))
    designs = [experiment.space.decode(rng.random(experiment.space.size)) for _ in range(count)]
    return [m for i, one in enumerate(designs) for m in experiment.plan.evaluation(0, i, one)]


def same(one: Any, other: Any) -> bool:
    """All bits of outcome and trajectory."""
    return repr(one[0]) == repr(other[0]) and one[1].tobytes() == other[1].tobytes()


def run_together(
    runner: Batcher, experiment: Experiment, chosen: Sequence[Mission]
) -> list[Rollout]:
    """Run missions of one experiment together."""
    (answer,) = runner.run([(experiment.scenario, chosen)])
    if isinstance(answer, NoKernel):
        raise answer
    return answer


def assert_same(experiment: Experiment, runner: Batcher, count: int = 2) -> None:
    chosen = missions(experiment, count)
    together = run_together(runner, experiment, chosen)
    alone = [run_mission(experiment.scenario, mission) for mission in chosen]
    assert all(map(same, together, alone))
    assert any(len(trajectory) > 10 for _, trajectory in alone)


def watch(seen: list[tuple[Loop, LoopInputs]]) -> Run:
    """A runner as in missions, which adds each loop and its inputs to ``seen``."""

    def run(call: LoopCall) -> LoopResult:
        seen.append(prepare(call.inputs))
        loop, inputs = seen[-1]
        return loop(inputs, *call[1:])

    return run


def run_interpreted(call: LoopCall) -> LoopResult:
    """Run the interpreted loop, and the rules with the functions that compiled ones have."""
    inputs = call.inputs
    changed: dict[str, Any] = {
        name: interpret_rule(getattr(inputs, name)) for name in ("observe", "sense", "advance")
    }
    for name in STAGES:
        stages = getattr(inputs, name)
        changed[name] = tuple(stage._replace(rule=interpret_rule(stage.rule)) for stage in stages)
    return run_loop(inputs._replace(**changed), *call[1:])

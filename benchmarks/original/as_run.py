"""Compares experiment=as_run with the original runs and finds what makes the difference.

Runs random designs under the conditions of the original runs, then with one condition changed at a
time, and evolves as the original runs did. Writes the tables of docs/original.md between their
marks and draws docs/img/original*.png:

    python benchmarks/original/as_run.py [folder] [workers]

This takes about 40,000 missions. Finished parts are kept in the folder (outputs/as_run), and the
next start continues from there. Delete the folder after a change that alters missions.
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import as_run_figures
import as_run_ranks
import as_run_report
import pandas as pd
from as_run_report import BASE

import evoros
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import TIME_LIMIT, Mission
from evoros.mission.plan import Plan
from evoros.mission.rollout import run_mission
from evoros.storage.layout import FINISHED
from evoros.storage.reading import load_run

NAVIGATION = {"l1": (), "serpentine": ("controller=rover",)}
TREATMENTS = ("none", "random", "spatial")
DESIGNS, VARIANT_DESIGNS, PHYSICS_DESIGNS, AGAIN_DESIGNS = 210, 90, 30, 60
SEEDS = range(10)
ATTEMPTS = 10  # at a mission that is run again if it takes too long
LATE = "+filter@design.sensors.sonar.filters.late=delay"
LATE_S = "design.sensors.sonar.filters.late.delay_s"
LOCK, TURNING = "robot.drive.steering_limit_rad", "robot.drive.turning_x_m"

VARIANTS: dict[str, tuple[str, ...]] = {
    "turns about its rear axle": (f"{TURNING}=null",),
    "turns about its origin": (f"{TURNING}=0",),
    "turns about its front axle": (f"{TURNING}=0.24",),
    "serpentine instead of l1": NAVIGATION["serpentine"],
    "the paper's rover": ("robot=erle_rover",),
    "pitch 12.5 deg": ("robot.mount.pitch_deg=12.5",),
    "the whole body touches": (
        *(f"robot.arguments.contact_{key}" for key in ("length=0.465", "width=0.325")),
        *(f"robot.arguments.contact_{key}" for key in ("height=0.115", "x=0.0175", "z=0.0875")),
        "robot.arguments.cage_collision=true",
    ),
    "wheels touch too": ("robot.arguments.contact_width=0.356",),
    # The bicycle model's angle is then the angle of both wheels, 0.7727 rad.
    "both front wheels alike": ("++robot.arguments.steering_limit=1.0", f"{LOCK}=0.98808"),
    "half the steering": (f"{LOCK}=0.386",),
    "a third of the steering": (f"{LOCK}=0.258",),
    "steering lags 0.3 s": ("simulator.steering_lag_s=0.3",),
    "positions exact": ("controller/localization=exact",),
    "positions 0.4 s late": ("controller.localization.delay.delay_s=0.4",),
    "positions 0.8 s late": ("controller.localization.delay.delay_s=0.8",),
    "positions 1.0 s late": ("controller.localization.delay.delay_s=1.0",),
    "as fast as it can": (
        "controller.navigation.speed_mps=0.397",
        "controller.avoidance.speed_mps=0.397",
    ),
    "readings exact": ("design.sensors.sonar.filters.noise.sigma_m=0",),
    "ten times the noise": ("design.sensors.sonar.filters.noise.sigma_m=0.05",),
    "readings 0.3 s late": (LATE, f"{LATE_S}=0.3"),
    "readings 0.6 s late": (LATE, f"{LATE_S}=0.6"),
    "readings 1 s late": (LATE, f"{LATE_S}=1.0"),
    "a decision every 0.5 s": ("controller.period_s=0.5",),
    "avoidance within 1.0 m": ("controller.avoidance.range_m=1.0",),
    "avoidance within 1.5 m": ("controller.avoidance.range_m=1.5",),
    "avoidance within 2.5 m": ("controller.avoidance.range_m=2.5",),
    "Eq. 2 divides by 4.5 m": ("controller.avoidance.max_range_m=4.5",),
    "the other direction": ("course.direction=backward",),
    "starts along the first leg": ("course.home_yaw_rad=0.785",),
    "a limit of 340 s": ("course.time_limit_s=340",),
}


@dataclass(frozen=True)
class Sample:
    """Random designs under one configuration, each with one mission in each world."""

    name: str
    overrides: tuple[str, ...]
    designs: int
    again: bool = False  # repeat a mission that the time limit ended before home
    trials: int = 1

    def run(self, folder: Path) -> str:
        """Run the missions, unless their file exists; it is created atomically."""
        file = folder / f"{self.name}.csv"
        if not file.exists():
            experiment = compose([*BASE, *self.overrides]).build()
            rows = [
                row
                for design_id in range(self.designs)
                for row in self._rows(experiment, design_id)
            ]
            part = file.with_suffix(f".{os.getpid()}")
            pd.DataFrame(rows).to_csv(part, index=False)
            part.replace(file)
        return self.name

    def _rows(self, experiment: Experiment, design_id: int) -> list[dict[str, object]]:
        # All configurations have the same designs, and each design has draws of its own.
        space = experiment.space
        design = space.decode(generator(f"{design_id}", "as_run").random(space.size))
        attempts = ATTEMPTS if self.again else self.trials
        plan = Plan(0, tuple(experiment.world), attempts, 0, "individual")
        rows = []
        for world in experiment.world:
            missions = [m for m in plan.selection(0, design_id, design) if m.world == world]
            rows += self._world(experiment, missions)
        return rows

    def _world(self, experiment: Experiment, missions: list[Mission]) -> list[dict[str, object]]:
        rows = []
        for mission in missions:
            (outcome,), _ = run_mission(experiment.scenario, mission)
            place = {"design": mission.design_id, "world": mission.world, "trial": mission.trial}
            rows.append(place | asdict(outcome))
            if self.again and (outcome.ended != TIME_LIMIT or outcome.visited >= 5):
                break
        return rows[-1:] if self.again else rows


@dataclass(frozen=True)
class Evolution:
    """One run of the original optimizer."""

    name: str
    overrides: tuple[str, ...]

    def run(self, folder: Path) -> str:
        """Evolve in a run folder, or resume an interrupted run."""
        path = folder / "runs" / self.name
        if (path / "status.json").exists():
            if load_run(path).status["state"] != FINISHED:
                evoros.resume(path)
        else:
            evoros.run([*BASE, "optimizer.validation_trials=0", *self.overrides], path)
        return self.name


Piece = Sample | Evolution | as_run_ranks.Ranking


def samples() -> list[Sample]:
    collected = [
        Sample(f"{name}_{treatment}", (*how, f"failure={treatment}"), DESIGNS)
        for name, how in NAVIGATION.items()
        for treatment in TREATMENTS
    ]
    collected += [Sample(name, how, VARIANT_DESIGNS) for name, how in VARIANTS.items()]
    limit, late = VARIANTS["a limit of 340 s"], VARIANTS["readings 1 s late"]
    for treatment in TREATMENTS:
        failure = f"failure={treatment}"
        collected += [
            Sample(f"axle_{treatment}", (f"{TURNING}=null", failure), VARIANT_DESIGNS),
            Sample(f"again_{treatment}", (*limit, failure), VARIANT_DESIGNS, again=True),
            Sample(f"late_{treatment}", (*limit, *late, failure), VARIANT_DESIGNS, again=True),
        ]
    collected += [Sample("repeated", (), AGAIN_DESIGNS, trials=5)]
    physics = ("simulator=pybullet", "simulator.steering_lag_s=0", f"{TURNING}=null")
    return [*collected, Sample("pybullet", physics, PHYSICS_DESIGNS)]


def evolutions() -> list[Evolution]:
    """The runs, seed by seed, so that a part of them is already comparable."""
    places = [(treatment, seed) for seed in SEEDS for treatment in TREATMENTS]
    uncounted = [
        Evolution(f"{name}_{treatment}_{seed}", (*how, f"failure={treatment}", f"seed={seed}"))
        for treatment, seed in places
        for name, how in NAVIGATION.items()
    ]
    return uncounted + [
        Evolution(
            f"logged_{treatment}_{seed}",
            (*as_logged(treatment), f"failure={treatment}", f"seed={seed}"),
        )
        for treatment, seed in places
    ]


def as_logged(treatment: str) -> tuple[str, ...]:
    """Overrides for the fitness that the originals counted, with their shares that drove on."""
    logged = as_run_report.ORIGINAL[treatment]["logged"]
    shares = ",".join(f"{world['went_on']:.3f}" for world in logged.values())
    return (
        "~fitness.sensor_penalty",
        "fitness._target_=as_logged.AsLogged",
        f"+fitness.went_on=[{shares}]",
    )


def main(folder: Path, workers: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    pieces: list[Piece] = [*as_run_ranks.rankings(), *samples(), *evolutions()]
    tasks: list[Callable[[], str]] = [partial(piece.run, folder) for piece in pieces]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for done, future in enumerate(as_completed(map(pool.submit, tasks)), 1):
            print(f"{done:3d} of {len(tasks)}  {future.result()}", flush=True)
    as_run_report.main(folder, VARIANTS, {"ranks": as_run_ranks.ranks, "parts": as_run_ranks.parts})
    as_run_figures.main(folder)


if __name__ == "__main__":
    main(
        Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/as_run"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 2,
    )

"""Ranks the designs of the original runs as as_run does, and compares with their own scores.

The logs score 318 different designs without failures (original_designs.csv). Each drives one
mission in each world and direction. The rank correlation of its fitness with that of the logs
tells how true to the original a configuration is, whatever makes its missions harder or easier.
"""

import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import as_run_report
import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.plan import Plan
from evoros.mission.rollout import run_mission
from evoros.sensor.protocol import Mount

DESIGNS = Path(__file__).with_name("original_designs.csv")
SENSORS = 6
PLACES = (None, -0.075, 0.0, 0.06, 0.12, 0.18, 0.24)  # turning points [m]; None: the rear axle
HOW = {
    "l1": (),
    "serpentine": ("controller=rover",),
    "serpentine, 12.5 deg": ("controller=rover", "robot.mount.pitch_deg=12.5"),
}
SAMPLES = 2000  # of the bootstrap


@dataclass(frozen=True)
class Ranking:
    """The designs of the logs under one configuration, in both directions."""

    name: str
    overrides: tuple[str, ...]

    def run(self, folder: Path) -> str:
        """Run the missions, unless their file exists; it is created atomically."""
        file = folder / f"{self.name}.csv"
        if not file.exists():
            rows = [
                row
                for direction in ("forward", "backward")
                for row in self._rows(direction, pd.read_csv(DESIGNS))
            ]
            part = file.with_suffix(f".{os.getpid()}")
            pd.DataFrame(rows).to_csv(part, index=False)
            part.replace(file)
        return self.name

    def _rows(self, direction: str, table: pd.DataFrame) -> list[dict[str, object]]:
        overrides = [*self.overrides, f"course.direction={direction}"]
        experiment = compose([*as_run_report.BASE, *overrides]).build()
        plan = Plan(0, tuple(experiment.world), 1, 0, "individual")
        rows = []
        for number, values in enumerate(table.itertuples(index=False)):
            design = logged_design(experiment, values[: 3 * SENSORS])
            for mission in plan.selection(0, number, design):
                outcome, _ = run_mission(experiment.scenario, mission)
                place = {"design": number, "world": mission.world, "trial": 0}
                rows.append(place | {"direction": direction} | asdict(outcome))
        return rows


def logged_design(experiment: Experiment, values: Iterable[float]) -> Design:
    """Return the design of a row: x [m], y [m] and yaw [deg] of each sensor."""
    robot = experiment.robot
    pitch = robot.default_pitch(experiment.scenario.design.sensors.values())
    genes = np.array(list(values)).reshape(-1, 3).tolist()
    return Design(
        tuple(
            Mount("sonar", robot.mount_link, x, y, robot.mount_z_m, yaw, pitch)
            for x, y, yaw in genes
        )
    )


def place_name(place: float | None) -> str:
    return "axle" if place is None else f"{place:+.3f}"


def rankings() -> list[Ranking]:
    """The configurations, those that matter most first."""
    chosen = [(how, place) for place in (0.12, None, 0.0, 0.24) for how in ("serpentine", "l1")]
    chosen += [("serpentine, 12.5 deg", place) for place in (None, 0.12)]
    return [
        Ranking(
            f"rank_{list(HOW).index(how)}_{place_name(place)}",
            (*HOW[how], f"robot.drive.turning_x_m={'null' if place is None else place}"),
        )
        for how, place in chosen
    ]


def correlation(first: Array, second: Array) -> float:
    """Spearman's, with the mean rank of what is equal."""
    return float(pd.Series(first).rank().corr(pd.Series(second).rank()))


def ranks(folder: Path) -> str:
    """The table of rank correlations with the logs, by turning point."""
    logs = pd.read_csv(DESIGNS).fitness.to_numpy()
    places = [place for place in PLACES if any(folder.glob(f"rank_*_{place_name(place)}.csv"))]
    rows = []
    for number, how in enumerate(HOW):
        cells = []
        for place in places:
            name = f"rank_{number}_{place_name(place)}"
            cells.append(_cell(folder, name, logs) if (folder / f"{name}.csv").exists() else "")
        rows.append([f"`{how}`", *cells])
    heads = [
        f"{-0.15 if place is None else place:g} m" + (" (rear axle)" if place is None else "")
        for place in places
    ]
    return as_run_report.table(["", *heads], rows)


def _cell(folder: Path, name: str, logs: Array) -> str:
    """The correlation, with the range of 95 % of bootstrap samples of the designs."""
    missions = as_run_report.read(folder, name)
    scores = missions.groupby("design").to_home.mean().to_numpy()
    rng = generator("0", "as_run_ranks")
    chosen = rng.integers(0, len(logs), (SAMPLES, len(logs)))
    low, high = np.quantile([correlation(logs[i], scores[i]) for i in chosen], [0.025, 0.975])
    return f"{correlation(logs, scores):.2f} ({low:.2f} to {high:.2f})"

"""Ranks the designs of the original runs as as_run does, and compares with their own scores.

The logs score 318 different designs without failures (original_designs.csv). Each drives one
mission in each world and direction. The rank correlation of its fitness with the logged fitness
tells how true to the original a configuration is, whatever makes its missions harder or easier.
"""

import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import as_run_report
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

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
PLACES = (None, 0.0, 0.12, 0.24)  # turning points [m]; None: the rear axle
HOW = {
    "l1": (),
    "serpentine": ("controller=rover",),
}
AXLE = "robot.drive.turning_x_m=null"
BACK_M = 0.27  # from the turning point at 0.12 m to the rear axle
SAMPLES = 2000  # of the bootstrap


@dataclass(frozen=True)
class Ranking:
    """The designs of the logs under one configuration, in both directions."""

    name: str
    overrides: tuple[str, ...]
    back_m: float = 0.0  # how far all sensors are set back

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
        for design_id, values in enumerate(table.itertuples(index=False)):
            design = logged_design(experiment, values[: 3 * SENSORS], self.back_m)
            for mission in plan.selection(0, design_id, design):
                (outcome,), _ = run_mission(experiment.scenario, mission)
                place = {"design": design_id, "world": mission.world, "trial": 0}
                rows.append(place | {"direction": direction} | asdict(outcome))
        return rows


def logged_design(experiment: Experiment, values: Iterable[float], back_m: float) -> Design:
    """Return the design of a row: x [m], y [m] and yaw [deg] of each sensor, set back."""
    robot = experiment.robot
    pitch = robot.default_pitch(experiment.design.sensors.values())
    genes = np.array(list(values)).reshape(-1, 3).tolist()
    return Design(
        tuple(
            Mount("sonar", robot.mount_link, x - back_m, y, robot.mount_z_m, yaw, pitch)
            for x, y, yaw in genes
        )
    )


def place_name(place: float | None) -> str:
    return "axle" if place is None else f"{place:+.3f}"


def rankings() -> list[Ranking]:
    """The configurations, those that matter most first."""
    rolling = (*HOW["serpentine"], AXLE)
    return [
        *(
            Ranking(
                f"rank_{list(HOW).index(how)}_{place_name(place)}",
                (*HOW[how], f"robot.drive.turning_x_m={'null' if place is None else place}"),
            )
            for place in PLACES
            for how in HOW
        ),
        Ranking("rank_box", (*rolling, f"robot.arguments.contact_x={0.05 - BACK_M}")),
        Ranking("rank_sensors", rolling, BACK_M),
    ]


def correlation(first: ArrayLike, second: ArrayLike) -> float:
    """Spearman's, with the mean rank of equal values."""
    ranks = [pd.Series(np.asarray(values)).rank() for values in (first, second)]
    return float(ranks[0].corr(ranks[1]))


def ranks(folder: Path) -> str:
    """The table of rank correlations with the logs, by turning point."""
    logs = pd.read_csv(DESIGNS).fitness.to_numpy()
    places = [place for place in PLACES if any(folder.glob(f"rank_*_{place_name(place)}.csv"))]
    rows = []
    for index, how in enumerate(HOW):
        cells = []
        for place in places:
            name = f"rank_{index}_{place_name(place)}"
            cells.append(_cell(folder, name, logs) if (folder / f"{name}.csv").exists() else "")
        rows.append([f"`{how}`", *cells])
    heads = [
        f"{-0.15 if place is None else place:g} m" + (" (rear axle)" if place is None else "")
        for place in places
    ]
    return as_run_report.table(["", *heads], rows)


def parts(folder: Path) -> str:
    """The table of what has to be where, relative to the turning point, with `serpentine`."""
    logs = pd.read_csv(DESIGNS).fitness.to_numpy()
    labels = {
        "rank_1_axle": "rear axle",
        "rank_1_+0.120": "x = 0.12 m",
        "rank_box": f"rear axle, the contact box {BACK_M} m further back",
        "rank_sensors": f"rear axle, the sensors {BACK_M} m further back",
    }
    rows = [[label, _cell(folder, name, logs)] for name, label in labels.items()]
    return as_run_report.table(["turning about the", "rank correlation"], rows)


def _cell(folder: Path, name: str, logs: Array) -> str:
    """The correlation, with the range of 95 % of bootstrap samples of the designs."""
    missions = as_run_report.read(folder, name)
    scores = missions.groupby("design").to_home.mean().to_numpy()
    rng = generator("0", "as_run_ranks")
    chosen = rng.integers(0, len(logs), (SAMPLES, len(logs)))
    low, high = np.quantile([correlation(logs[i], scores[i]) for i in chosen], [0.025, 0.975])
    return f"{correlation(logs, scores):.2f} ({low:.2f} to {high:.2f})"

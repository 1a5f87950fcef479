"""The evolution in a recording: fitness, and the best design of each generation."""

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr

from evoros.base.arrays import Array

from ..tables.candidates import place_candidates, read_generations
from ..tables.designs import to_number
from ..tables.generations import select_bests, trace_fitness
from ..tables.records import Record
from ..video.captions import CLEAR
from ..video.scene import ShownRobot
from .entities import Entities
from .robot import show_links
from .sensors import LINE, draw_fan, place_fan

EVOLUTION = "evolution"
FAN_M = 0.5
"""The length of the fan of a sensor; its range would hide the robot."""
_NAMES = {"recorded": "best", "validated": "best, validated", "mean": "mean"}


def show_evolution(top: Entities, record: Record, urdf: str, most_faces: int) -> None:
    """Show fitness, and the sensors of the best designs on the body of the robot ``urdf``."""
    table = read_generations(record)
    for line, values in trace_fitness(table).dropna(axis=1, how="all").items():
        _plot(top.below("fitness", str(line)), _NAMES[str(line)], values.dropna())
    bests = select_bests(table).reset_index()
    generations = bests["generation"].astype(int).tolist()
    _plot_champion(top.below("fitness", "champion"), record, generations[-1])
    scene = top.below("best")
    scene.show(rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    robot = ShownRobot(urdf, most_faces)
    body = [link for link in robot.surfaces if not _is_sensor(link, record)]
    show_links(scene.below("robot"), robot, body)
    sensors = place_candidates(bests.drop_duplicates("id"), record)
    fans = {design: _draw(rows) for design, rows in sensors.groupby("design")}
    shown = [fans.get(design, []) for design in bests["id"]]
    strips = [fan for design in shown for fan in design]
    columns = rr.LineStrips3D.columns(
        strips=strips, colors=[CLEAR] * len(strips), radii=[LINE] * len(strips)
    )
    sizes = [len(design) for design in shown]
    scene.below("sensors").show_over_generations(generations, columns.partition(sizes))
    texts = [_describe(row, record) for row in bests.to_dict("records")]
    top.below("text").show_over_generations(generations, rr.TextDocument.columns(text=texts))


def _is_sensor(link: str, record: Record) -> bool:
    """Whether a link is a sensor of a design."""
    kind, _, number = link.rpartition("_")
    return number.isdigit() and any(kind.endswith(name) for name in record.context.types)


def _draw(sensors: pd.DataFrame) -> list[Array]:
    """Return the fans of the sensors of a design in the frame of the robot."""
    names = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "fov_deg", "range_m")
    fans = []
    for x, y, z, yaw, pitch, fov, reach in sensors[[*names]].to_numpy(float).tolist():
        fan = draw_fan(min(reach, FAN_M), np.radians(max(fov, 1.0)) / 2)
        fans.append(place_fan(np.array([x, y, z]), np.radians(yaw), np.radians(pitch), fan))
    return fans


def _plot(top: Entities, name: str, values: "pd.Series[float]") -> None:
    top.show(rr.SeriesLines(names=name))
    columns = rr.Scalars.columns(scalars=values.to_numpy(float))
    top.show_over_generations(values.index.astype(int).tolist(), columns)


def _plot_champion(top: Entities, record: Record, generation: int) -> None:
    """Plot the fitness of the champion in the last generation."""
    top.show(rr.SeriesPoints(names="champion", markers="asterisk", marker_sizes=8.0))
    fitness = to_number(record.run.status.get("best_fitness"))
    top.show_over_generations([generation], rr.Scalars.columns(scalars=[fitness]))


def _describe(row: Mapping[Hashable, Any], record: Record) -> str:
    champion = int(record.run.champion["design"].iloc[0])
    named = " (the champion)" if row["id"] == champion else ""
    return (
        f"Generation {row['generation']}: design {row['id']}{named}, fitness {row['fitness']:.4g}"
    )

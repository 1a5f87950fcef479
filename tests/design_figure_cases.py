"""A robot with regions, and champions on it, for figures of designs."""

import argparse
import json
import math
from pathlib import Path

import pandas as pd
from helpers import reseal

from evoros.analysis.subcommands import Product, import_subcommand
from evoros.analysis.tables.loading import load_study
from evoros.design.protocol import Area
from evoros.storage.figure_context import Beam, FigureContext, Part, Ring

RINGS = (Ring(0.03, 1.0), Ring(0.06, 2 / 3), Ring(0.09, 1 / 3))
SETTING = FigureContext(
    robot="box",
    parts=(
        Part("base", ((-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1)), 0.0, 0.15, False),
        Part("wheel", ((0.1, 0.12),), 0.05, 0.1, True),
    ),
    places={"base": (0.0, 0.0, 0.0, 0.0)},
    beams={"sonar": Beam(30.0, 0.06, 1.0, 0.1)},
    regions={
        "left": Area(
            "base_link",
            ((0.0, 0.05), (0.2, 0.05), (0.2, 0.1), (0.0, 0.1)),
            (40.0, 90.0),
            (0.1, 0.1),
            (0.0, 0.0),
        ),
        "front": Area(
            "base_link",
            ((0.15, -0.05), (0.2, -0.05), (0.2, 0.05), (0.15, 0.05)),
            (-30.0, 30.0),
            (0.1, 0.1),
            (0.0, 0.0),
        ),
    },
    mirrored=True,
    rings=RINGS,
    modes=("avoiding", "navigating"),
    courses={},
)
NAN = math.nan


def sensor(x: float, y: float, yaw: float, run: str = "a", **more: object) -> dict[str, object]:
    """A sonar of 30 degrees and 1 m, by itself a pair."""
    place = {"x_m": x, "y_m": y, "z_m": 0.1, "yaw_deg": yaw, "pitch_deg": 0.0}
    beam = {"fov_deg": 30.0, "range_m": 1.0, "type": "sonar"}
    known = {"run": run, "treatment": "all runs", "seed": 0, "design": 7, "sensor": 0, "pair": 0}
    return {**known, **place, **beam, "fitness": 18.04, "validated_fitness": 16.96, **more}


def bare(run: str, **more: object) -> dict[str, object]:
    """A champion without sensors."""
    row = sensor(NAN, NAN, NAN, run)
    return {**row, "sensor": None, "pair": None, "type": None, "range_m": NAN, **more}


def table(*rows: dict[str, object]) -> pd.DataFrame:
    frame = pd.DataFrame(list(rows))
    return frame.astype({"sensor": "Int64", "pair": "Int64"})


PAIRS = (
    sensor(0, 0.1, -70, sensor=0, pair=0),
    sensor(0, -0.1, 70, sensor=1, pair=0),
    sensor(0.1, 0.1, 10, sensor=2, pair=1),
    sensor(0.1, -0.1, -10, sensor=3, pair=1),
    sensor(0.2, 0.0, 40, sensor=4, pair=2),
    sensor(0.2, 0.0, -40, sensor=5, pair=2),
)


def folder(path: Path, setting: FigureContext = SETTING, seed: int = 0, mounts: str = "") -> Path:
    """A finished run, of the files that these figures read."""
    (path / "champion").mkdir(parents=True)
    header = "design,sensor,type,link,x_m,y_m,z_m,yaw_deg,pitch_deg\n"
    status = {"state": "finished", "best_fitness": 17.0 + seed, "best_validated_fitness": 15.0}
    files = {
        "config.yaml": f"seed: {seed}\nfailure: {{_target_: a.{path.parent.name}.B}}\n",
        "manifest.json": json.dumps(
            {"command": "evoros", "choices": {"failure": path.parent.name}}
        ),
        "status.json": json.dumps(status),
        "missions.csv": "generation,design,world,trial\n",
        "setting.json": setting.text,
        "champion/design.csv": header + mounts,
        "champion/genes.csv": "design,gene,key,value\n",
    }
    for name, text in files.items():
        (path / name).write_text(text)
    return reseal(path)


TWO = "3,0,sonar,base,0.1,0.05,0.1,30,0\n3,1,sonar,base,0.1,-0.05,0.1,-30,0\n"


def product(name: str, *paths: Path, **options: object) -> Product:
    given = {"columns": None, "cut": None, "run": None, **options}
    made: Product = import_subcommand(name).make_product(
        load_study(paths), argparse.Namespace(**given)
    )
    return made

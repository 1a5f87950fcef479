"""Summarizes the logs of the original runs in original.json and original_designs.csv, beside it.

The 30 logs are in the study's public workspace, github.com/gsimon2/ros_catkin_ws_src at 4d56eb3,
as evo_ros/GA/logs/6_sonar_symmetric_placement_*.dat. Each row has the results of three missions:
the share of the time that was left (negative if not completed) and the progress in percent. Needs a
clone:

    python benchmarks/original/original_logs.py FOLDER_OF_THE_LOGS
"""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

TREATMENTS = {
    "without_failure": "none",
    "with_complete_failure": "random",
    "with_aoe_failure": "spatial",
}
WORLDS = ("boxes", "maze", "blocks")
TARGET = Path(__file__).with_name("original.json")
DESIGNS = Path(__file__).with_name("original_designs.csv")
NAME = re.compile(r"6_sonar_symmetric_placement_(\w+)_run(\d+)\.dat")
SENSORS = 6
PENALTY = 1.8  # subtracted from Eq. 1 in the logs
HOME, TENTH = 60.0, 10.0  # [%] progress as reported at home; progress for a waypoint
FROM_HOME = 50.0  # [%] progress above it is from the second phase, except HOME itself


def rows(folder: Path) -> Iterator[dict[str, object]]:
    """Yield a row for each individual in each of its generations."""
    for file in sorted(folder.iterdir()):
        if not (match := NAME.fullmatch(file.name)) or match[1] not in TREATMENTS:
            continue
        for line in file.read_text(errors="replace").splitlines():
            cells = [cell.strip() for cell in line.rstrip(", ").split(",")]
            results = 4 + 3 * SENSORS
            if len(cells) < results + 2 * len(WORLDS) or not cells[0].isdigit():
                continue
            numbers = list(map(float, cells))
            row: dict[str, object] = {
                "treatment": TREATMENTS[match[1]],
                "run": int(match[2]),
                "generation": int(numbers[0]),
                "id": int(numbers[1]),
                "fitness": numbers[2] + PENALTY,
                "genes": tuple(numbers[4:results]),
            }
            for i, world in enumerate(WORLDS):
                row[f"left_{world}"], row[f"progress_{world}"] = numbers[results + 2 * i :][:2]
            yield row


def worlds(designs: pd.DataFrame) -> dict[str, dict[str, object]]:
    """The shares of the designs by how their missions ended, for each world."""
    shares: dict[str, dict[str, object]] = {}
    for world in WORLDS:
        progress, left = designs[f"progress_{world}"], designs[f"left_{world}"]
        done = left >= 0
        stood = np.isclose(progress, HOME)
        # The last leg home ends below 50 %, so any progress above it is from the second phase.
        on = (progress > FROM_HOME) & ~stood
        shares[world] = {
            "home": float((stood | on).mean()),
            "ended_at_home": float(stood.mean()),
            "went_on": float(on.sum() / max((stood | on).sum(), 1)),
            "completed": float(done.mean()),
            "time_limit": float(np.isclose(left, -3).mean()),
            "waypoints": [  # the share with 0, 1 ... 4 waypoints when the mission ended before home
                float((~stood & ~on & (progress // TENTH).clip(upper=4).eq(n)).mean())
                for n in range(5)
            ],
        }
    return shares


def curves(table: pd.DataFrame) -> dict[str, object]:
    """Statistics of the runs of one treatment, as a whole and by generation."""
    per = table.groupby(["generation", "run"]).fitness
    best, mean = per.max().unstack(), per.mean().unstack()
    spread = table.drop_duplicates(["run", "id"]).groupby(["run", "genes"]).fitness.std()
    return {
        "final_best": float(best.ffill().iloc[-1].mean()),
        "highest": float(best.max().max()),
        "last_improvement": float(best.cummax().idxmax().mean()),
        "drops": int((best.diff() < -1e-9).any().sum()),
        "best": [round(value, 3) for value in best.mean(axis=1)],
        "mean": [round(value, 3) for value in mean.mean(axis=1)],
        "again_sd": float(spread.mean()),
    }


def designs(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each design that was scored without failures, with its mean fitness."""
    once = table[table.treatment == "none"].drop_duplicates(["run", "id"])
    scores = once.groupby("genes").fitness.agg(["mean", "size"]).reset_index()
    names = [f"{name}_{i}" for i in range(SENSORS) for name in ("x_m", "y_m", "yaw_deg")]
    genes = pd.DataFrame(scores.genes.tolist(), columns=names)
    return genes.assign(fitness=scores["mean"].round(4), times=scores["size"])


def main(folder: Path) -> None:
    table = pd.DataFrame(rows(folder))
    designs(table).to_csv(DESIGNS, index=False)
    summary: dict[str, object] = {}
    for treatment, runs in table.groupby("treatment"):
        first = runs[runs.generation == 0]
        summary[str(treatment)] = {
            "runs": runs.run.nunique(),
            "random_designs": len(first),
            "first": worlds(first),
            "logged": worlds(runs.drop_duplicates(["run", "id"])),
            "quantiles": list(first.fitness.quantile(np.linspace(0, 1, 21)).round(3)),
            "first_mean": float(first.fitness.mean()),
            "first_best": list(first.groupby("run").fitness.max().round(3)),
            **curves(runs),
        }
    table = table.drop_duplicates(["treatment", "run", "id"])
    times = (1 - table.left_blocks[table.left_blocks >= 0]) * 540
    summary["completed_s"] = [float(times.min()), float(times.median()), float(times.max())]
    TARGET.write_text(json.dumps(summary, indent=1) + "\n")
    print(TARGET.read_text())


if __name__ == "__main__":
    main(Path(sys.argv[1]))

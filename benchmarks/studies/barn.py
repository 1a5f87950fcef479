"""Tabulates BARN scores of designs on the same worlds, with intervals over the worlds.

Each argument is an evaluation; trial N of all of them is the same world. The first design is the
reference: the others are compared with it world by world (permutation of signs, Holm).
docs/barn.md has the commands that make the evaluations:

    python benchmarks/studies/barn.py outputs/gap outputs/front
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from evoros.analysis.statistics.paired import sign_flips
from evoros.analysis.statistics.small_samples import holm, mean_interval, share_interval
from evoros.fitness.barn import score_mission
from evoros.mission.outcome import COLLISION, COMPLETED
from evoros.storage.tables import read_outcomes


def read_missions(folder: Path) -> pd.DataFrame:
    """Read the missions of an evaluation: what each design scored in each trial."""
    with (folder / "missions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    outcomes = [read_outcomes(row)[0] for row in rows]
    return pd.DataFrame(
        {
            "design": [f"{folder.name} {row['design']}" for row in rows],
            "trial": [int(row["trial"]) for row in rows],
            "score": [score_mission(outcome) for outcome in outcomes],
            "ended": [outcome.ended for outcome in outcomes],
            "time_s": [outcome.time_s for outcome in outcomes],
            "sensors": [outcome.sensors for outcome in outcomes],
            "price": [outcome.price for outcome in outcomes],
        }
    )


def tabulate(missions: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each design; p compares it with the first one."""
    scores = missions.pivot(index="trial", columns="design", values="score")
    names = list(dict.fromkeys(missions["design"]))
    others = {name: (scores[name] - scores[names[0]]).dropna().to_numpy() for name in names[1:]}
    adjusted = dict(zip(others, holm([sign_flips(each) for each in others.values()]), strict=True))
    rows = []
    for name in names:
        mine = missions[missions["design"] == name]
        done = mine["ended"] == COMPLETED
        rows.append(
            {
                "design": name,
                "sensors": int(mine["sensors"].iloc[0]),
                "price": f"{mine['price'].iloc[0]:g}",
                "worlds": len(mine),
                "score": mean_interval(mine["score"].to_numpy()).write(".3f"),
                "success": share_interval(int(done.sum()), len(mine)).write(".1%"),
                "collision": f"{(mine['ended'] == COLLISION).mean():.1%}",
                "time_s": f"{mine.loc[done, 'time_s'].mean():.1f}",
                "difference": ""
                if name not in others
                else mean_interval(others[name]).write("+.3f"),
                "p": "" if name not in others else f"{adjusted[name]:.2g}",
            }
        )
    return pd.DataFrame(rows)


def main(folders: Sequence[str]) -> None:
    """Print the table of these evaluations."""
    missions = pd.concat([read_missions(Path(folder)) for folder in folders])
    table = tabulate(missions)
    print("| " + " | ".join(map(str, table)) + " |")
    print("|" + "---|" * len(table.columns))
    for row in table.to_numpy():
        print("| " + " | ".join(map(str, row)) + " |")


if __name__ == "__main__":
    main(sys.argv[1:])

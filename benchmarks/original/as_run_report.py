"""Tables of benchmarks/original/as_run.py, from what it has left in its folder."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from as_logged import AT_HOME, HOME

from evoros.storage.reading import load_run

ROOT = Path(__file__).parents[2]
BASE = ("experiment=as_run", "simulator=planar", "executor=serial", "figures=[]")
DOCUMENT = ROOT / "docs" / "original.md"
ORIGINAL: dict[str, Any] = json.loads(Path(__file__).with_name("original.json").read_text())
BEGIN, END = "<!-- measured: {} -->", "<!-- end: {} -->"
TREATMENTS, WORLDS = ("none", "random", "spatial"), ("boxes", "maze", "blocks")
NAMES = {
    "l1": "`l1`",
    "axle": "`l1`, turning about the rear axle",
    "again": "and run again after 340 s",
    "late": "and readings 1 s late",
}
POPULATION = 30
PENALTY = 1.8  # for six sensors; subtracted from Eq. 1 in the recorded fitness of as_run


def read(folder: Path, name: str) -> pd.DataFrame:
    """The missions of a sample, scored by Eq. 1 as a whole and as if all of them ended at home."""
    missions = pd.read_csv(folder / f"{name}.csv")
    left = np.where(missions.completed, (2 - missions.time_s / missions.time_limit_s) ** 2, 0.0)
    missions["whole"] = (1 + missions.progress) ** 2 + left
    missions["to_home"] = (1 + missions.progress.clip(upper=AT_HOME)) ** 2
    missions["home"] = missions.visited >= HOME
    return missions


def designs(missions: pd.DataFrame, score: str) -> pd.Series:
    """The fitness of each design, in each trial if it has several."""
    several = missions.duplicated(["design", "world"]).any()
    return missions.groupby(["design", "trial"] if several else "design")[score].sum()


def best_of(scores: pd.Series) -> float:
    """The mean over the best designs of groups of thirty."""
    whole = len(scores) // POPULATION * POPULATION
    return float(scores.to_numpy()[:whole].reshape(-1, POPULATION).max(axis=1).mean())


def share(missions: pd.DataFrame, column: str) -> list[str]:
    return [f"{missions[missions.world == world][column].mean():.0%}" for world in WORLDS]


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines])


def random_designs(folder: Path, treatments: Iterable[str] = TREATMENTS) -> str:
    """The table of shares that get home and complete, and of fitness, against the logs."""
    rows: list[list[object]] = []
    for treatment in treatments:
        logs = ORIGINAL[treatment]
        home = " / ".join(f"{logs['first'][world]['home']:.0%}" for world in WORLDS)
        done = " / ".join(f"{logs['first'][world]['completed']:.1%}" for world in WORLDS)
        best = float(np.mean(logs["first_best"]))
        rows.append(
            [treatment, "logs, 300 designs", home, done, f"{logs['first_mean']:.2f}", f"{best:.2f}"]
        )
        for name, label in {**NAMES, "serpentine": "`serpentine`"}.items():
            missions = read(folder, f"{name}_{treatment}")
            whole, to_home = (designs(missions, score) for score in ("whole", "to_home"))
            rows.append(
                [
                    "",
                    label,
                    " / ".join(share(missions, "home")),
                    " / ".join(share(missions, "completed")),
                    f"{to_home.mean():.2f} ({whole.mean():.2f})",
                    f"{best_of(to_home):.2f} ({best_of(whole):.2f})",
                ]
            )
    head = ["treatment", "", "get home", "complete", "mean fitness", "best of 30"]
    return table(head, rows)


def ends(folder: Path) -> str:
    """The table of where missions of random designs end, by waypoints."""
    rows = []
    for world in WORLDS:
        logs = ORIGINAL["none"]["first"][world]
        rows.append(
            [world, "logs", *(f"{x:.0%}" for x in logs["waypoints"]), f"{logs['home']:.0%}"]
        )
        for name, label in NAMES.items():
            missions = read(folder, f"{name}_none").query("world == @world")
            counts = [float((missions.visited == n).mean()) for n in range(HOME)]
            rows.append(["", label, *(f"{x:.0%}" for x in counts), f"{missions.home.mean():.0%}"])
    return table(["world", "", "0", "1", "2", "3", "4", "home"], rows)


def variants(folder: Path, names: Iterable[str]) -> str:
    """The table of samples with one changed condition."""
    logs = ORIGINAL["none"]
    rows: list[list[object]] = [
        [
            "**the logs**",
            *(f"{logs['first'][world]['home']:.0%}" for world in WORLDS),
            "0% / 0% / 0%",
            f"{logs['first_mean']:.2f}",
            "",
        ]
    ]
    physics, all_designs = read(folder, "pybullet"), read(folder, "l1_none")
    rolling = read(folder, "axle_none")  # about the rear axle, as in physics
    changed = {name: read(folder, name) for name in names}
    last = max(missions.design.max() for missions in changed.values())
    series = {"**as_run**": all_designs[all_designs.design <= last], **changed}
    series["pybullet, about the rear axle"] = physics
    series["planar, the same designs and axle"] = rolling[rolling.design <= physics.design.max()]
    for label, missions in series.items():
        whole, to_home = (designs(missions, score) for score in ("whole", "to_home"))
        rows.append(
            [
                label,
                *share(missions, "home"),
                " / ".join(share(missions, "completed")),
                f"{to_home.mean():.2f}",
                f"{whole.mean():.2f}",
            ]
        )
    return table(["", *WORLDS, "complete", "counted to home", "Eq. 1"], rows)


def curves(folder: Path, name: str, treatment: str) -> pd.DataFrame:
    """The fitness by Eq. 1 of every candidate, by generation and run."""
    tables = []
    for path in sorted((folder / "runs").glob(f"{name}_{treatment}_*")):
        run = load_run(path).generations
        tables.append(run.assign(run=path.name))
    members = pd.concat(tables, ignore_index=True)
    members["fitness"] += 0.0 if name == "logged" else PENALTY
    return members


def evolutions(folder: Path, treatments: Iterable[str] = TREATMENTS) -> str:
    """The table of the curves of runs."""
    rows: list[list[object]] = []
    for treatment in treatments:
        logs = ORIGINAL[treatment]
        rows.append(
            [
                treatment,
                "logs",
                f"{np.mean(logs['first_best']):.2f}",
                f"{logs['final_best']:.2f}",
                f"{logs['highest']:.2f}",
                f"{logs['last_improvement']:.1f}",
                f"{logs['drops']} of {logs['runs']}",
            ]
        )
        for name, label in (
            ("logged", "`l1`, counted as logged"),
            ("l1", "`l1`"),
            ("serpentine", "`serpentine`"),
        ):
            per = curves(folder, name, treatment).groupby(["generation", "run"]).fitness
            best = per.max().unstack()
            drops = int((best.diff() < -1e-9).any().sum())
            rows.append(
                [
                    "",
                    label,
                    f"{best.iloc[0].mean():.2f}",
                    f"{best.iloc[-1].mean():.2f}",
                    f"{best.max().max():.2f}",
                    f"{best.cummax().idxmax().mean():.1f}",
                    f"{drops} of {best.shape[1]}",
                ]
            )
    head = ["treatment", "", "first best", "final best", "highest", "last improvement", "drops"]
    return table(head, rows)


def spread(folder: Path) -> str:
    """The table of the same designs under several draws."""
    missions = read(folder, "repeated")
    return table(
        ["", "standard deviation of a design's fitness over five trials, mean of 60 designs"],
        [
            [label, f"{designs(missions, score).groupby('design').std().mean():.2f}"]
            for score, label in (("to_home", "counted to home"), ("whole", "Eq. 1"))
        ],
    )


def write(parts: dict[str, str]) -> None:
    """Write each table that the page has marks for between them."""
    text = DOCUMENT.read_text()
    for name, content in parts.items():
        begin, end = BEGIN.format(name), END.format(name)
        if begin in text:
            before, _, rest = text.partition(begin)
            text = f"{before}{begin}\n{content}\n{end}{rest.partition(end)[2]}"
    DOCUMENT.write_text(text)


def main(folder: Path, names: Iterable[str], more: Mapping[str, Callable[[Path], str]]) -> None:
    """Print all tables, and write those of the page; ``more`` makes those of other modules."""
    parts: dict[str, Callable[[Path], str]] = {
        **more,
        "designs": lambda where: random_designs(where, TREATMENTS[:1]),
        "designs of all treatments": random_designs,
        "ends": ends,
        "variants": lambda where: variants(where, names),
        "runs": lambda where: evolutions(where, TREATMENTS[:1]),
        "runs of all treatments": evolutions,
        "repeated": spread,
    }
    tables = {name: make(folder) for name, make in parts.items()}
    for name, content in tables.items():
        print(f"\n{name}\n{content}")
    write(tables)

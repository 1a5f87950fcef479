"""Tables and figures of benchmarks/as_run.py, from what it has left in its folder."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from as_logged import AT_HOME, HOME
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.runs import load_run

ROOT = Path(__file__).parents[1]
DOCUMENT, IMAGES = ROOT / "docs" / "original.md", ROOT / "docs" / "img"
ORIGINAL: dict[str, Any] = json.loads(Path(__file__).with_name("original.json").read_text())
BEGIN, END = "<!-- measured: {} -->", "<!-- end: {} -->"
TREATMENTS, WORLDS = ("none", "random", "spatial"), ("boxes", "maze", "blocks")
POPULATION = 30
PENALTY = 1.8  # of six sensors, in the recorded fitness of as_run and not in Eq. 1
LOGS, RUNS, COUNTED = "black", "#0072b2", "#d55e00"
STYLE: dict[Any, Any] = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}


def read(folder: Path, name: str) -> pd.DataFrame:
    """Missions with what they count: by Eq. 1, and by Eq. 1 where every mission ends at home."""
    missions = pd.read_csv(folder / f"{name}.csv")
    left = np.where(missions.completed, (2 - missions.time_s / missions.time_limit_s) ** 2, 0.0)
    missions["whole"] = (1 + missions.progress) ** 2 + left
    missions["to_home"] = (1 + missions.progress.clip(upper=AT_HOME)) ** 2
    missions["home"] = missions.visited >= HOME
    return missions


def designs(missions: pd.DataFrame, score: str) -> pd.Series:
    """The fitness of each design in each trial."""
    return missions.groupby(["design", "trial"] if missions.trial.any() else "design")[score].sum()


def best_of(scores: pd.Series) -> float:
    """Mean of the best of each thirty."""
    whole = len(scores) // POPULATION * POPULATION
    return float(scores.to_numpy()[:whole].reshape(-1, POPULATION).max(axis=1).mean())


def share(missions: pd.DataFrame, column: str) -> list[str]:
    return [f"{missions[missions.world == world][column].mean():.0%}" for world in WORLDS]


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines])


def random_designs(folder: Path) -> str:
    """Shares that get home and complete, and fitness, against the logs."""
    rows: list[list[object]] = []
    for treatment in TREATMENTS:
        logs = ORIGINAL[treatment]
        home = " / ".join(f"{logs['first'][world]['home']:.0%}" for world in WORLDS)
        done = " / ".join(f"{logs['first'][world]['completed']:.1%}" for world in WORLDS)
        best = float(np.mean(logs["first_best"]))
        rows.append(
            [treatment, "logs, 300 designs", home, done, f"{logs['first_mean']:.2f}", f"{best:.2f}"]
        )
        for name in ("l1", "again", "serpentine"):
            missions = read(folder, f"{name}_{treatment}")
            label = {"again": "l1, flown again after 340 s"}.get(name, name)
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
    """Where missions of random designs end, by waypoints."""
    rows = []
    for world in WORLDS:
        logs = ORIGINAL["none"]["first"][world]
        rows.append(
            [world, "logs", *(f"{x:.0%}" for x in logs["waypoints"]), f"{logs['home']:.0%}"]
        )
        for name, label in (("l1", "l1"), ("again", "l1, flown again after 340 s")):
            missions = read(folder, f"{name}_none").query("world == @world")
            counts = [float((missions.visited == n).mean()) for n in range(HOME)]
            rows.append(["", label, *(f"{x:.0%}" for x in counts), f"{missions.home.mean():.0%}"])
    return table(["world", "", "0", "1", "2", "3", "4", "home"], rows)


def variants(folder: Path, names: Iterable[str]) -> str:
    """One condition changed at a time."""
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
    for name in ("l1_none", *names, "pybullet"):
        missions = read(folder, name)
        whole, to_home = (designs(missions, score) for score in ("whole", "to_home"))
        rows.append(
            [
                "**as_run**" if name == "l1_none" else name,
                *share(missions, "home"),
                " / ".join(share(missions, "completed")),
                f"{to_home.mean():.2f}",
                f"{whole.mean():.2f}",
            ]
        )
    return table(["", *WORLDS, "complete", "counted to home", "Eq. 1"], rows)


def curves(folder: Path, name: str, treatment: str) -> pd.DataFrame:
    """Eq. 1 of every member, by generation and run."""
    found = []
    for path in sorted((folder / "runs").glob(f"{name}_{treatment}_*")):
        run = load_run(path).generations
        found.append(run.assign(run=path.name))
    members = pd.concat(found, ignore_index=True)
    members["fitness"] += 0.0 if name == "logged" else PENALTY
    return members


def evolved(folder: Path) -> str:
    """The curve of a run in four numbers."""
    rows: list[list[object]] = []
    for treatment in TREATMENTS:
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
            ("logged", "l1, counted as logged"),
            ("l1", "l1"),
            ("serpentine", "serpentine"),
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
    """The same designs again, under fresh draws."""
    missions = read(folder, "repeated")
    return table(
        ["", "standard deviation of a design's fitness over five trials, mean of 60 designs"],
        [
            [label, f"{designs(missions, score).groupby('design').std().mean():.2f}"]
            for score, label in (("to_home", "counted to home"), ("whole", "Eq. 1"))
        ],
    )


def draw_designs(folder: Path) -> Figure:
    """Distribution of fitness, and how many get home in each world."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.7), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1))
        quantiles = ORIGINAL["none"]["quantiles"]
        left.plot(quantiles, np.linspace(0, 1, len(quantiles)), color=LOGS, label="the logs")
        missions = read(folder, "l1_none")
        for score, colour, dashes, label in (
            ("to_home", COUNTED, "--", "here, counted to home"),
            ("whole", RUNS, "-.", "here, whole missions"),
        ):
            values = np.sort(designs(missions, score))
            heights = np.arange(1, len(values) + 1) / len(values)
            left.plot(values, heights, color=colour, ls=dashes, label=label)
        left.set(xlabel="fitness (Eq. 1)", ylabel="share of random designs", ylim=(0, 1.02))
        left.legend(frameon=False, loc="lower right")
        _homes(right, folder)
    return figure


def _homes(axes: Axes, folder: Path) -> None:
    """A group of points for each world: treatments side by side."""
    for i, world in enumerate(WORLDS):
        for j, treatment in enumerate(TREATMENTS):
            x = i + 0.2 * (j - 1)
            missions = read(folder, f"l1_{treatment}").query("world == @world")
            again = read(folder, f"again_{treatment}").query("world == @world")
            logs = ORIGINAL[treatment]["first"][world]["home"]
            first = i == j == 0
            for value, colour, marker, label in (
                (logs, LOGS, "o", "the logs"),
                (float(missions.home.mean()), RUNS, "s", "here"),
                (float(again.home.mean()), COUNTED, "^", "flown again after 340 s"),
            ):
                axes.plot(x, value, marker, color=colour, ms=4, label=label if first else None)
    axes.set_xticks(range(len(WORLDS)), [f"{w}\nnone, random, spatial" for w in WORLDS], fontsize=6)
    axes.set(ylabel="share that gets home", ylim=(0, 1))
    axes.legend(frameon=False, fontsize=7)


def draw_runs(folder: Path) -> Figure:
    """Best and mean of each generation, means of ten runs."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.6), layout="constrained")
        for axes, treatment in zip(
            figure.subplots(1, 3, sharex=True, sharey=True), TREATMENTS, strict=True
        ):
            logs = ORIGINAL[treatment]
            axes.plot(logs["best"], color=LOGS, label="the logs")
            axes.plot(logs["mean"], color=LOGS, ls=":")
            for name, colour, label in (
                ("logged", COUNTED, "here, counted as logged"),
                ("l1", RUNS, "here, whole missions"),
            ):
                per = curves(folder, name, treatment).groupby(["generation", "run"]).fitness
                axes.plot(per.max().unstack().mean(axis=1), color=colour, label=label)
                axes.plot(per.mean().unstack().mean(axis=1), color=colour, ls=":")
            axes.set(xlabel="generation", title=treatment)
        figure.axes[0].set(ylabel="fitness (Eq. 1)", ylim=(4, 20))
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def write(parts: dict[str, str]) -> None:
    """Put each table between its marks."""
    text = DOCUMENT.read_text()
    for name, content in parts.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, _, rest = text.partition(begin)
        text = f"{before}{begin}\n{content}\n{end}{rest.partition(end)[2]}"
    DOCUMENT.write_text(text)


def main(folder: Path, names: Iterable[str]) -> None:
    parts: dict[str, Callable[[Path], str]] = {
        "designs": random_designs,
        "ends": ends,
        "variants": lambda where: variants(where, names),
        "runs": evolved,
        "repeated": spread,
    }
    found = {name: make(folder) for name, make in parts.items()}
    for name, content in found.items():
        print(f"\n{name}\n{content}")
    write(found)
    for name, draw in (("original", draw_designs), ("original_runs", draw_runs)):
        draw(folder).savefig(IMAGES / f"{name}.png", dpi=300)

"""What trials and validation do to the winner's curse in world=dense.

Evolves with 1, 2, 4 and 8 trials, several seeds each, and scores on 40 fresh trials what each run
would hand over: the best as recorded, and the best as validated. It compares runs of as many
generations, and runs of as many missions. Resumable: what is in the folder is not computed again.

    python benchmarks/studies/winners_curse.py [folder] [seeds]

It prints the table and writes docs/img/winners_curse.png.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from evoros.analysis.drawing.style import COLUMN_IN, STYLE, save
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import evoros
from evoros.session import run as session
from evoros.session.replay import replay_designs

GENERATIONS = {1: 42, 2: 21, 4: 10, 8: 10}  # by trials: enough for both comparisons
FEWEST = 10  # generations, at the first comparison
MISSIONS = 1250  # of the selection, at most, at the second comparison
FRESH = 40  # trials of the final score
EQUAL = ("generations", "missions")
BASE = ["world=dense", "simulator=planar", "figures=[]"]
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "winners_curse.png"
KEYS = ["trials", "seed", "equal", "chosen"]
LINES = {  # label: column, chosen by, colour (Okabe-Ito), marker
    "best recorded: as recorded": ("stated", "recorded", "#d55e00", "o"),
    "best recorded: on fresh trials": ("fresh", "recorded", "#0072b2", "s"),
    "best validated: on fresh trials": ("fresh", "validated", "#009e73", "^"),
}


def evolved(folder: Path, trials: int, seed: int) -> evoros.Run:
    """The run in the folder, begun or finished if need be."""
    path = folder / f"trials_{trials}_seed_{seed}"
    if not (path / "missions.csv").exists():
        more = [f"trials={trials}", f"seed={seed}"]
        return evoros.run([*BASE, *more, f"optimizer.generations={GENERATIONS[trials]}"], path)
    run = evoros.load_run(path)
    return run if run.status["state"] == "finished" else evoros.resume(path)


def last_generation(run: evoros.Run, equal: str) -> int:
    """The generation at which a run is compared."""
    if equal == "generations":
        return FEWEST - 1
    flown = run.missions[run.missions.purpose == "selection"].groupby("generation").size().cumsum()
    return int(flown[flown <= MISSIONS].index.max())


def handed_over(run: evoros.Run) -> Iterator[tuple[str, str, int, float]]:
    """What is compared, by what the design was chosen, its id, and the fitness it was chosen by."""
    for equal in EQUAL:
        table = run.generations[run.generations.generation <= last_generation(run, equal)]
        now = table[table.generation == table.generation.max()]
        best = now.loc[now.fitness.idxmax()]
        yield equal, "recorded", int(best.id), float(best.fitness)
        best = table.dropna(subset="validated_fitness").nlargest(1, "validated_fitness").iloc[0]
        yield equal, "validated", int(best.id), float(best.validated_fitness)


def scored(run: evoros.Run, trials: int, seed: int) -> list[dict[str, object]]:
    """A row for each design that is handed over, with its fitness on fresh trials."""
    found = replay_designs(run, session.rebuild_experiment(run.path))
    chosen = list(handed_over(run))
    ids = sorted({one for _, _, one, _ in chosen})
    with evoros.Evaluator([*BASE, f"trials={FRESH}", f"seed={seed}"]) as evaluator:
        table = evaluator.evaluate([found[one] for one in ids])
    done = table.filter(like="_completed").mean(axis=1)
    rows = []
    for equal, by, one, stated in chosen:
        at = ids.index(one)
        values = (trials, seed, equal, by, stated, table.fitness_mean[at], done[at])
        rows.append(dict(zip([*KEYS, "stated", "fresh", "completed"], values, strict=True)))
    return rows


def results(folder: Path, seeds: int) -> pd.DataFrame:
    """All rows; what is not in ``scores.csv`` yet is computed and added."""
    file = folder / "scores.csv"
    for seed in range(seeds):
        for trials in GENERATIONS:
            known = pd.read_csv(file) if file.exists() else pd.DataFrame(columns=KEYS)
            if ((known.seed == seed) & (known.trials == trials)).any():
                continue
            rows = pd.DataFrame(scored(evolved(folder, trials, seed), trials, seed))
            pd.concat([known, rows] if len(known) else [rows]).to_csv(file, index=False)
            print(rows.to_string(index=False, header=False), flush=True)
    return pd.read_csv(file)


def panel(axes: Axes, table: pd.DataFrame) -> None:
    """Each run as a point, the mean over the seeds as a line."""
    for offset, (label, (column, by, colour, marker)) in enumerate(LINES.items()):
        rows = table[table.chosen == by]
        x = np.log2(rows.trials) + 0.08 * (offset - 1)
        axes.scatter(x, rows[column], s=8, c=colour, marker=marker, alpha=0.45, linewidths=0)
        mean = rows.groupby("trials")[column].mean()
        axes.plot(np.log2(mean.index), mean, color=colour, marker=marker, ms=4, lw=1.2, label=label)
    axes.set_xticks(np.log2(list(GENERATIONS)), [str(trials) for trials in GENERATIONS])
    axes.set_xlabel("trials")
    axes.spines[["top", "right"]].set_visible(False)


def figure(table: pd.DataFrame) -> Figure:
    """One panel for runs of as many generations, one for runs of as many missions."""
    with mpl.rc_context(STYLE):
        whole = Figure(figsize=(2 * COLUMN_IN, 0.95 * COLUMN_IN), layout="constrained")
        panels = whole.subplots(1, 2, sharey=True)
        titles = (f"{FEWEST} generations", f"{MISSIONS} missions in selection")
        for axes, equal, title in zip(panels, EQUAL, titles, strict=True):
            panel(axes, table[table.equal == equal])
            axes.set_title(title, fontsize=8)
        panels[0].set_ylabel("fitness (Eq. 1)")
        handles, labels = panels[0].get_legend_handles_labels()
        whole.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return whole


def main(folder: Path, seeds: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    table = results(folder, seeds)
    table = table.assign(curse=table.stated - table.fresh)
    columns = ["stated", "fresh", "curse", "completed"]
    print(
        table.groupby(["equal", "chosen", "trials"])[columns]
        .agg(["mean", "std"])
        .round(2)
        .to_string()
    )
    save(figure(table), FIGURE, "png")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path("outputs/winners_curse"),
        int(sys.argv[2]) if len(sys.argv) > 2 else 5,
    )

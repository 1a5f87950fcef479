"""Measures the effect of trials and validation on the winner's curse in world=dense.

Evolves with 1, 2, 4 and 8 trials and several seeds. Each run ends with two designs: the best by
recorded and the best by validated fitness. The script scores both on 40 fresh trials, and compares
runs with equal numbers of generations and runs with equal numbers of missions. It prints the table
and writes docs/img/winners_curse.png. Parts that are already in the folder are not computed again:

    python benchmarks/studies/winners_curse.py [folder] [seeds]
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import evoros
from evoros.analysis.drawing.style import COLUMN_IN, save, use_style
from evoros.session.rebuilding import rebuild
from evoros.session.replay import replay_designs

GENERATIONS = {1: 42, 2: 21, 4: 10, 8: 10}  # by trials, enough for both comparisons
COMPARED_GENERATIONS = 10  # in the first comparison
MAX_MISSIONS = 1250  # of the selection, in the second comparison
FRESH_TRIALS = 40  # of the final score
EQUAL = ("generations", "missions")
BASE = ["world=dense", "simulator=planar", "figures=[]"]
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "winners_curse.png"
KEYS = ["trials", "seed", "equal", "chosen"]
LINES = {  # label: column, chosen by, colour (Okabe-Ito), marker
    "best recorded: as recorded": ("stated", "recorded", "#d55e00", "o"),
    "best recorded: on fresh trials": ("fresh", "recorded", "#0072b2", "s"),
    "best validated: on fresh trials": ("fresh", "validated", "#009e73", "^"),
}


def evolve(folder: Path, trials: int, seed: int) -> evoros.Run:
    """Return the run in the folder; start or finish it if necessary."""
    path = folder / f"trials_{trials}_seed_{seed}"
    if not (path / "missions.csv").exists():
        more = [f"trials={trials}", f"seed={seed}"]
        return evoros.run([*BASE, *more, f"optimizer.generations={GENERATIONS[trials]}"], path)
    run = evoros.load_run(path)
    return run if run.status["state"] == "finished" else evoros.resume(path)


def last_generation(run: evoros.Run, equal: str) -> int:
    """The generation at which a run is compared."""
    if equal == "generations":
        return COMPARED_GENERATIONS - 1
    selection = run.missions[run.missions.purpose == "selection"]
    missions = selection.groupby("generation").size().cumsum()
    return int(missions[missions <= MAX_MISSIONS].index.max())


def final_designs(run: evoros.Run) -> Iterator[tuple[str, str, int, float]]:
    """Yield the comparison, how the design was chosen, its id, and its fitness by that choice."""
    for equal in EQUAL:
        table = run.generations[run.generations.generation <= last_generation(run, equal)]
        now = table[table.generation == table.generation.max()]
        best = now.loc[now.fitness.idxmax()]
        yield equal, "recorded", int(best.id), float(best.fitness)
        best = table.dropna(subset="validated_fitness").nlargest(1, "validated_fitness").iloc[0]
        yield equal, "validated", int(best.id), float(best.validated_fitness)


def score(run: evoros.Run, trials: int, seed: int) -> list[dict[str, object]]:
    """A row for each final design, with its fitness on fresh trials."""
    designs = replay_designs(run, rebuild(run.path).experiment)
    chosen = list(final_designs(run))
    ids = sorted({design_id for _, _, design_id, _ in chosen})
    with evoros.Evaluator([*BASE, f"trials={FRESH_TRIALS}", f"seed={seed}"]) as evaluator:
        table = evaluator.evaluate([designs[design_id] for design_id in ids])
    done = table.filter(like="_completed").mean(axis=1)
    rows = []
    for equal, by, design_id, stated in chosen:
        at = ids.index(design_id)
        values = (trials, seed, equal, by, stated, table.fitness_mean[at], done[at])
        rows.append(dict(zip([*KEYS, "stated", "fresh", "completed"], values, strict=True)))
    return rows


def results(folder: Path, seeds: int) -> pd.DataFrame:
    """All rows; computes those that are not yet in ``scores.csv`` and adds them."""
    file = folder / "scores.csv"
    for seed in range(seeds):
        for trials in GENERATIONS:
            known = pd.read_csv(file) if file.exists() else pd.DataFrame(columns=KEYS)
            if ((known.seed == seed) & (known.trials == trials)).any():
                continue
            rows = pd.DataFrame(score(evolve(folder, trials, seed), trials, seed))
            pd.concat([known, rows] if len(known) else [rows]).to_csv(file, index=False)
            print(rows.to_string(index=False, header=False), flush=True)
    return pd.read_csv(file)


def panel(axes: Axes, table: pd.DataFrame) -> None:
    """Draw each run as a point and the mean over the seeds as a line."""
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
    """Draw one panel for runs with equal generations and one for runs with equal missions."""
    with use_style():
        whole = Figure(figsize=(2 * COLUMN_IN, 0.95 * COLUMN_IN), layout="constrained")
        panels = whole.subplots(1, 2, sharey=True)
        titles = (f"{COMPARED_GENERATIONS} generations", f"{MAX_MISSIONS} missions in selection")
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

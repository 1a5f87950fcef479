"""Scores designs of a BARN run on fresh worlds, and the front of these on the public ones.

The recorded scores of a run are lucky ones, as most designs drive in three worlds only. So the
best of each price by a bound drive in fresh drawn worlds. Those that score above all cheaper ones
are the front, which drives in the public worlds, and in other simulators:

    python benchmarks/studies/barn_choice.py RUN FOLDER [PUBLIC_WORLDS [SIMULATOR TRIALS]]

FOLDER gets a folder for each table of missions. What is there is not computed again.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from barn import read_missions

import evoros
from evoros import Design
from evoros.session.replay import replay_designs
from evoros.session.run import rebuild_experiment
from evoros.storage.tables import design_table, to_csv

PRICE = "objectives.robustness"
DEVIATION = 0.25  # of the score of one mission, subtracted once over the root of the trials
EACH = 2  # candidates of each price
FRESH = 40  # drawn worlds in which the candidates drive
PUBLIC = 300
BASE = ["experiment=barn", "fitness.way_weight=0", "executor=serial"]


def list_candidates(run: evoros.Run) -> list[int]:
    """Return the designs of each price with the highest lower bound of the fitness."""
    lives = run.generations.sort_values("generation").groupby("id").tail(1)
    bound = lives["fitness"] - DEVIATION / lives["trials"] ** 0.5
    best = lives.assign(bound=bound).sort_values("bound", ascending=False)
    chosen = best.groupby(PRICE).head(EACH).sort_values([PRICE, "id"])
    return [int(one) for one in chosen["id"]]


def score(folder: Path, designs: Sequence[Design], overrides: Sequence[str]) -> None:
    """Write the missions of designs into a folder that has none."""
    file = folder / "missions.csv"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        with evoros.Evaluator([*BASE, *overrides]) as evaluator:
            table = evaluator.missions(designs)
        file.write_text(to_csv([list(table), *table.to_numpy(object).tolist()]))
        (folder / "design.csv").write_text(design_table(dict(enumerate(designs))))


def find_front(folder: Path) -> list[int]:
    """Return the designs whose score is above those of all cheaper ones."""
    designs = read_missions(folder).groupby("design", sort=False)
    rows = designs.agg(price=("price", "first"), score=("score", "mean")).reset_index(drop=True)
    rows = rows.sort_values(["price", "score"], ascending=[True, False])
    above = rows["score"] > rows["score"].cummax().shift(fill_value=-1.0)
    return [int(one) for one in rows[above].index]


def main(
    run: str, folder: str, worlds: str = "", simulator: str = "", trials: str = str(PUBLIC)
) -> None:
    """Score the candidates, and the front in public worlds."""
    loaded = evoros.load_run(run)
    ids = list_candidates(loaded)
    known = replay_designs(loaded, rebuild_experiment(loaded.path))
    candidates = [known[one] for one in ids]
    fresh = Path(folder) / "candidates"
    score(fresh, candidates, [f"trials={FRESH}", "seed=1000"])
    chosen = find_front(fresh)
    front = [candidates[one] for one in chosen]
    print("front:", [ids[one] for one in chosen])
    if not worlds:
        return
    public = ["world=barn_files", "~world.barn", f"world.barn_files.folder={worlds}"]
    score(Path(folder) / "public", front, [*public, f"trials={PUBLIC}"])
    if simulator:
        more = [*public, f"trials={trials}", f"simulator={simulator}"]
        score(Path(folder) / simulator, front, more)


if __name__ == "__main__":
    main(*sys.argv[1:])

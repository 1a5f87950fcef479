"""Scores designs of a BARN run on fresh worlds, and the front of these on the public ones.

The recorded scores of a run are lucky ones, as most designs drive in three worlds only. So the
best of each price by a bound drive in fresh drawn worlds. Those that score above all cheaper ones
are the front, which drives in the public worlds, and in other simulators:

    python benchmarks/studies/barn_choice.py RUN FOLDER [PUBLIC_WORLDS [SIMULATOR TRIALS]]

FOLDER gets a folder for each table of missions. What is there is not computed again. A run with
another design than experiment=barn has needs it here, too: --override design=challenge_lidar.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from barn import read_missions

import evoros
from evoros import Design
from evoros.session.replay import replay_designs
from evoros.session.run import rebuild_experiment
from evoros.storage.design_files import design_table
from evoros.storage.tables import to_csv

PRICE = "objectives.robustness"
DEVIATION = 0.25  # of the score of one mission, subtracted once over the root of the trials
EACH, LEAST = 2, 8  # candidates of each price, and of a run with few prices
FRESH = 40  # drawn worlds in which the candidates drive
PUBLIC = 300
BASE = ["experiment=barn", "fitness.way_weight=0", "executor=serial"]


def list_candidates(run: evoros.Run) -> list[int]:
    """Return the designs of each price with the highest lower bound of the fitness."""
    lives = run.generations.sort_values("generation").groupby("id").tail(1)
    bound = lives["fitness"] - DEVIATION / lives["trials"] ** 0.5
    best = lives.assign(bound=bound).sort_values("bound", ascending=False)
    each = max(EACH, LEAST // best[PRICE].nunique())
    chosen = best.groupby(PRICE).head(each).sort_values([PRICE, "id"])
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


def read_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run")
    parser.add_argument("folder", type=Path)
    parser.add_argument("worlds", nargs="?", help="folder of the public worlds")
    parser.add_argument("simulator", nargs="?")
    parser.add_argument("trials", nargs="?", default=PUBLIC)
    parser.add_argument("--override", action="append", default=[], help="KEY=VALUE")
    return parser.parse_args()


def main() -> None:
    """Score the candidates, and the front in public worlds."""
    given = read_arguments()
    loaded = evoros.load_run(given.run)
    ids = list_candidates(loaded)
    known = replay_designs(loaded, rebuild_experiment(loaded.path))
    candidates = [known[one] for one in ids]
    fresh = given.folder / "candidates"
    score(fresh, candidates, [*given.override, f"trials={FRESH}", "seed=1000"])
    chosen = find_front(fresh)
    front = [candidates[one] for one in chosen]
    print("front:", [ids[one] for one in chosen])
    if not given.worlds:
        return
    files = ["world=barn_files", "~world.barn", f"world.barn_files.folder={given.worlds}"]
    public = [*files, *given.override]
    score(given.folder / "public", front, [*public, f"trials={PUBLIC}"])
    if given.simulator:
        more = [*public, f"trials={given.trials}", f"simulator={given.simulator}"]
        score(given.folder / given.simulator, front, more)


if __name__ == "__main__":
    main()

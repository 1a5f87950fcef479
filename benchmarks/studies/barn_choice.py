"""Chooses designs of BARN runs for fresh trials, and of these the front of score and price.

The recorded scores of a run are lucky ones, as most designs drive in three worlds only. So:

    python benchmarks/studies/barn_choice.py candidates outputs/barn outputs/candidates
    evoros evaluate like=outputs/barn designs=outputs/candidates/design.csv trials=60 \
        fitness.way_weight=0 record=none hydra.run.dir=outputs/chosen
    python benchmarks/studies/barn_choice.py front outputs/barn outputs/front outputs/chosen

The first command writes the best of each price by a bound, the last one those whose score on the
fresh worlds is above the scores of all cheaper ones.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

import evoros
from evoros.session.replay import replay_designs
from evoros.session.run import rebuild_experiment
from evoros.storage.tables import design_table, gene_table

PRICE = "objectives.robustness"
DEVIATION = 0.25  # of the score of one mission, subtracted once over the root of the trials
EACH = 2  # candidates of each price


def list_candidates(run: evoros.Run) -> list[int]:
    """Return the designs of each price with the highest lower bound of the fitness."""
    lives = run.generations.sort_values("generation").groupby("id").tail(1)
    bound = lives["fitness"] - DEVIATION / lives["trials"] ** 0.5
    best = lives.assign(bound=bound).sort_values("bound", ascending=False)
    chosen = best.groupby(PRICE).head(EACH).sort_values([PRICE, "id"])
    return [int(one) for one in chosen["id"]]


def find_front(evaluation: Path) -> list[int]:
    """Return the designs whose score is above those of all cheaper ones."""
    designs = pd.read_csv(evaluation / "designs.csv")["design"]
    missions = pd.read_csv(evaluation / "missions.csv")
    prices = missions.groupby("design")["price"].first()
    scores = pd.read_csv(evaluation / "designs.csv")["fitness_mean"]
    rows = pd.DataFrame({"id": designs, "price": prices.to_numpy(), "score": scores})
    rows = rows.sort_values(["price", "score"], ascending=[True, False])
    above = rows["score"] > rows["score"].cummax().shift(fill_value=-1.0)
    return [int(one) for one in rows[above]["id"]]


def write_designs(run: evoros.Run, ids: Sequence[int], folder: Path) -> None:
    """Write designs and their genes as ``evoros evaluate`` reads them."""
    experiment = rebuild_experiment(run.path)
    designs = replay_designs(run, experiment)
    spaces = experiment.space.spaces.items()
    names = {
        robot: {gene.key: name for name, gene in space.genes.items()} for robot, space in spaces
    }
    chosen = {one: designs[one] for one in ids}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "design.csv").write_text(design_table(chosen))
    (folder / "genes.csv").write_text(gene_table(chosen, names))
    print(f"{len(ids)} designs in {folder}: {', '.join(map(str, ids))}")


def main(command: str, run: str, folder: str, evaluation: str = "") -> None:
    """Write the candidates of a run, or the front of those in an evaluation."""
    loaded = evoros.load_run(run)
    ids = list_candidates(loaded) if command == "candidates" else find_front(Path(evaluation))
    write_designs(loaded, ids, Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])

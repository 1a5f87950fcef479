"""The study of plugins/barn/README.md: how few range sensors cross the worlds of BARN?

Runs the searches, scores their designs in fresh drawn worlds and in the public ones, and beside
them the hand-made controller. Prints all tables, and writes its page's and docs/img/barn.png. What
the folder has already is not computed again:

    python benchmarks/studies/barn.py WORLDS [FOLDER] [--jackal XACRO] [--simulators NAME ...]

WORLDS is the folder of the public worlds, and XACRO the public description of the Jackal. In other
simulators, designs of the first search drive in every 15th world.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from barn_picture import draw
from barn_tables import (
    choose,
    fill,
    list_reached,
    read_missions,
    summarize,
    tabulate_comparisons,
    tabulate_searches,
    tabulate_worlds,
    write_table,
)
from noise import run_long

import evoros
from evoros import Design
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.session.rebuilding import rebuild
from evoros.session.replay import replay_designs
from evoros.storage.champion_files import design_table
from evoros.storage.tables import to_csv

PAGE = Path(__file__).parents[2] / "evoros" / "plugins" / "barn" / "README.md"
HAND = "hand-made, lidar"
BARN, GAP = ["experiment=barn"], ["experiment=barn_gap"]
PLAIN = ["~design.genes", "optimizer=random_search"]  # the configured design
FEWER = "design.sensors.scan.beams=90"  # to search by
SEEDS, GENERATIONS, TUNING_GENERATIONS = range(5), 60, 25
GROUPS: list[tuple[str, list[str], list[str], range, int]] = [  # what changes; only to search by
    ("searches", [], [], SEEDS, GENERATIONS),
    ("lidar", ["design=challenge_lidar"], [FEWER], range(3), 30),
]
PRICE = "objectives.robustness"
DEVIATION = 0.25  # of the score of one mission, subtracted once over the root of the trials
EACH, LEAST = 2, 8  # candidates of each price, and of a run with few prices
FRESH = ["trials=40", "seed=1000"]
PUBLIC, EVERY = 300, 15  # public worlds, and which of them in other simulators
CONFIRMED = (24.0, 600.0)  # budgets whose designs drive there
JACKAL = ["robot=own", "robot.drive.max_speed_mps=2"]
JACKAL += ["design.fixed.scan.z_m=0.2145"]  # 0.278 m above the ground, as on ours
Find = Callable[[], Sequence[Design]]


@dataclass(frozen=True)
class Study:
    """The folder of the study, and that of the public worlds."""

    folder: Path
    worlds: Path

    def score(self, name: str, find: Find | None, setting: Sequence[str]) -> Path:
        """Return the folder of the missions of designs, or of the configured one; fly if needed."""
        folder = self.folder / name
        if not (folder / "missions.csv").is_file():
            with evoros.Evaluator([*setting, *([] if find else PLAIN)]) as evaluator:
                designs = find() if find else [evaluator.space.decode(np.zeros(0))]
                table = evaluator.missions(designs)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "design.csv").write_text(design_table(dict(enumerate(designs))))
            content = to_csv([list(table), *table.to_numpy(object).tolist()])
            (folder / "missions.csv").write_text(content)
        return folder

    def use_public(self, every: int = 1) -> list[str]:
        """Return the setting of an evaluation in the public worlds, or in some of them."""
        folder = self.worlds if every == 1 else self.folder / "spread"
        for number in range(0, PUBLIC if every > 1 else 0, every):
            for name in (f"world_{number}.world", f"path_files/path_{number}.npy"):
                if not (folder / name).is_symlink():
                    (folder / name).parent.mkdir(parents=True, exist_ok=True)
                    (folder / name).symlink_to(self.worlds / name)
        place = f"world.barn_files.folder='{folder}'"
        return ["world=barn_files", place, f"trials={PUBLIC // every}"]

    def search(self, group: str, setting: Sequence[str], seed: int, length: int) -> evoros.Run:
        """Return a run of a sweep; start or finish it if necessary."""
        sweep = self.folder / group
        path = next(sweep.glob(f"*seed-{seed}*"), sweep / f"seed-{seed}")
        return run_long(path, [*setting, f"seed={seed}"], length)

    def find_front(self, run: evoros.Run, name: str, setting: Sequence[str]) -> list[Design]:
        """Return the designs of a run that are above all cheaper ones in fresh worlds."""
        designs = list_designs(run)
        candidates = [designs[one] for one in list_candidates(run)]
        fresh = self.score(f"{name}/candidates", lambda: candidates, [*setting, *FRESH])
        return [candidates[one] for one in list_front(summarize(read_missions(fresh)))]

    def score_searches(self) -> Iterator[Path]:
        """Yield the scored fronts of all searches, those with the lidar last."""
        for group, kind, fewer, seeds, length in GROUPS:
            setting = [*BARN, *kind]
            for seed in seeds:
                run = self.search(group, [*setting, *fewer], seed, length)
                name = f"{group}_scored/{seed}"
                find = partial(self.find_front, run, name, setting)
                public = [*setting, "~world.barn", *self.use_public()]
                yield self.score(f"{name}/public", find, public)

    def score_hand_made(self, name: str, robot: Sequence[str]) -> Iterator[Path]:
        """Yield the evaluations of the hand-made controller as it is, and as tuned."""
        public = [*GAP, *robot, *self.use_public()]
        yield self.score(name, None, public)
        tuning = [*GAP, *robot, FEWER, "final_choice=halving"]
        run = run_long(self.folder / f"{name}_tuning", tuning, TUNING_GENERATIONS)
        best = int(run.champion.design.iloc[0])
        yield self.score(f"{name}_tuned", lambda: [list_designs(run)[best]], public)

    def confirm(self, public: Path, simulators: Sequence[str]) -> str:
        """Write the scores of the hand-made robot and of designs of the first search."""
        front, names = summarize(read_missions(public)), name_designs(public)
        chosen = [int(choose([front], budget).index[0]) for budget in CONFIRMED]

        def find() -> list[Design]:
            run = self.search("searches", BARN, SEEDS[0], GENERATIONS)
            designs = self.find_front(run, f"searches_scored/{SEEDS[0]}", BARN)
            return [designs[one] for one in chosen]

        columns = []
        for simulator in simulators:
            setting = [*self.use_public(EVERY), f"simulator={simulator}"]
            hand = self.score(f"gap_{simulator}", None, [*GAP, *setting])
            evolved = self.score(f"evolved_{simulator}", find, [*BARN, "~world.barn", *setting])
            missions = [*read_missions(hand).values(), *read_missions(evolved).values()]
            columns.append(
                [mean_interval(one["score"].to_numpy()).write(".3f") for one in missions]
            )
        rows = zip([HAND, *(names[one] for one in chosen)], *columns, strict=True)
        return write_table(["design", *simulators], [*rows])


def list_designs(run: evoros.Run) -> Mapping[int, Design]:
    """Return all designs of a run."""
    return replay_designs(run, rebuild(run.path).experiment)


def list_candidates(run: evoros.Run) -> list[int]:
    """Return the designs of each price with the highest lower bound of the fitness.

    Most have driven in three worlds only, so that the recorded scores of the best are lucky ones.
    """
    lives = run.generations.sort_values("generation").groupby("id").tail(1)
    bound = lives["fitness"] - DEVIATION / lives["trials"] ** 0.5
    best = lives.assign(bound=bound).sort_values("bound", ascending=False)
    each = max(EACH, LEAST // best[PRICE].nunique())
    chosen = best.groupby(PRICE).head(each).sort_values([PRICE, "id"])
    return [int(one) for one in chosen["id"]]


def list_front(designs: pd.DataFrame) -> list[int]:
    """Return the designs whose score is above those of all cheaper ones."""
    above = designs["score"] > designs["score"].cummax().shift(fill_value=-1.0)
    return [int(one) for one in designs[above].index]


def name_designs(folder: Path) -> dict[int, str]:
    """Return a name with the sensors of each design of an evaluation."""
    sensors = pd.read_csv(folder / "design.csv").groupby("design")["type"]
    kinds = {design: types.value_counts(sort=False).items() for design, types in sensors}
    return {
        int(str(design)): f"{number}: {', '.join(f'{n} {kind}' for kind, n in counts) or 'blind'}"
        for number, (design, counts) in enumerate(kinds.items(), 1)
    }


def main(study: Study, jackal: Path | None, simulators: Sequence[str]) -> None:
    """Run what is missing, fill the page and draw the picture."""
    scored = [*study.score_searches()]
    gap, tuned = (read_missions(one).popitem()[1] for one in study.score_hand_made("gap", []))
    designs = [read_missions(one) for one in scored]
    fronts = [summarize(one) for one in designs]
    reached = list_reached(fronts[: len(SEEDS)], fronts[len(SEEDS) :])
    first = {name: designs[0][one] for one, name in name_designs(scored[0]).items()}
    hand = {HAND: gap, f"{HAND}, tuned": tuned}
    tables = {
        "searches": tabulate_searches(reached),
        "comparisons": tabulate_comparisons(reached, float(gap["score"].mean())),
        "worlds": tabulate_worlds(hand | first, dict.fromkeys([f"{HAND}, tuned", *first], HAND)),
    }
    if jackal:
        robot = [*JACKAL, f"robot.description='{jackal}'"]
        both = [read_missions(one).popitem()[1] for one in study.score_hand_made("jackal", robot)]
        theirs = {f"{name}, public Jackal": one for name, one in zip(hand, both, strict=True)}
        against = dict(zip(theirs, hand, strict=True))
        tables["platforms"] = tabulate_worlds(hand | theirs, against)
    if simulators:
        tables["simulators"] = study.confirm(scored[0], simulators)
    for name, table in tables.items():
        print(f"\n{name}\n{table}")
    PAGE.write_text(fill(PAGE.read_text(), tables))
    run = study.search("searches", BARN, SEEDS[0], GENERATIONS)
    draw(run.path, scored[0], fronts[: len(SEEDS)], reached, hand)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("worlds", type=Path)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("outputs/barn"))
    parser.add_argument("--jackal", type=Path)
    parser.add_argument("--simulators", nargs="+", default=[])
    given = parser.parse_args()
    main(Study(given.folder.resolve(), given.worlds.resolve()), given.jackal, given.simulators)

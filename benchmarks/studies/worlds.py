"""Draws worlds from above for docs/worlds.md.

    python benchmarks/studies/worlds.py [run]

Writes docs/img/generated.png. With the folder of a run in world=dense, also writes
docs/img/dense.png with the tracks of its champion.
"""

import sys
from pathlib import Path

import evoros
from evoros.analysis.drawing.style import save
from evoros.analysis.drawing.worlds import draw_worlds
from evoros.config.compose import compose
from evoros.world.model import World

IMAGES = Path(__file__).parents[2] / "docs" / "img"
EXAMPLES = {
    "density 0.08, gap 1.3 m": [],
    "density 0.16, gap 0.6 m": ["density=0.16", "gap_m=0.6"],
    "density 0.3, gap 0.2 m, open": ["density=0.3", "gap_m=0.2", "enclosed=false"],
}


def generated(overrides: list[str]) -> World:
    keys = [f"world.generated.{override}" for override in overrides]
    return compose(["world=generated", *keys]).build().world["generated"]


def main(folders: list[str]) -> None:
    examples = {name: generated(overrides) for name, overrides in EXAMPLES.items()}
    save(draw_worlds(examples), IMAGES / "generated.png", "png")
    for folder in folders:
        run, dense = evoros.load_run(folder), compose(["world=dense"]).build().world
        tracks = {name: [run.trajectory(name)[["x_m", "y_m"]].to_numpy()] for name in dense}
        save(draw_worlds(dense, tracks), IMAGES / "dense.png", "png")


if __name__ == "__main__":
    main(sys.argv[1:])

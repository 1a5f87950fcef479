"""The pictures of the documents are small, and all are written by one function."""

import io
from pathlib import Path

import numpy as np
import pytest
from documents import DOCS
from helpers import ROOT
from PIL import Image

from evoros.analysis.drawing.style import VISIBLE, save_png

LARGEST = 3_000_000


def test_the_pictures_are_small() -> None:
    assert sum(file.stat().st_size for file in (DOCS / "img").iterdir()) <= LARGEST


def test_no_script_writes_pictures_by_itself() -> None:
    writers = {"analysis/drawing/style.py"}
    names = {
        str(file.relative_to(ROOT))
        for folder in ("analysis", "benchmarks", "docs")
        for file in (ROOT / folder).rglob("*.py")
        if ".savefig(" in file.read_text()
    }
    assert names == writers


def reread(picture: Image.Image) -> tuple[Image.Image, int]:
    file = io.BytesIO()
    save_png(picture, file)
    return Image.open(io.BytesIO(file.getvalue())), len(file.getvalue())


@pytest.mark.parametrize("seed", range(3))
def test_few_colours_become_a_palette_and_stay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (40, 3), dtype=np.uint8)
    pixels = np.kron(rng.integers(0, 40, (30, 20)), np.ones((8, 8), dtype=int))
    picture = Image.fromarray(colours[pixels])
    small, size = reread(picture)
    plain = io.BytesIO()
    picture.save(plain, "PNG")
    assert (small.mode, small.size) == ("P", picture.size)
    assert size < len(plain.getvalue())
    error = np.abs(np.asarray(small.convert("RGB"), dtype=int) - np.asarray(picture)).mean()
    assert error <= VISIBLE


def test_a_photograph_keeps_its_colours_and_transparency_its_own() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (60, 60, 4), dtype=np.uint8)
    for mode, picture in (
        ("RGB", Image.fromarray(pixels[..., :3].copy())),
        ("RGBA", Image.fromarray(pixels)),
    ):
        again, _ = reread(picture)
        assert again.mode == mode
        assert np.array_equal(np.asarray(again), np.asarray(picture))


def test_the_folder_has_nothing_else() -> None:
    kinds = {Path(file).suffix for file in (DOCS / "img").iterdir() if file.is_file()}
    assert kinds <= {".png", ".svg", ".py"}

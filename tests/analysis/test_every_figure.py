"""Rules for any figure of evoros analyze, in one and two columns, also in a journal's style."""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from figure_checks import find_faults
from helpers import scored, texts, tiny, vary
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.analysis.drawing.finish import LETTERS, list_panels
from evoros.analysis.drawing.style import choose_style, finish, use_style
from evoros.analysis.products import make_product
from evoros.analysis.subcommands import EXPORTS, SUBCOMMANDS, import_subcommand, parse
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.study import Study
from evoros.terminal.console import DONE

SHOWN = (
    "optimizer.generations=2",
    "+measure@descriptors.front=front_coverage",
    "+measure@descriptors.side=side_coverage",
    "+measure@objectives.fitness=fitness",
    "+measure@objectives.robustness=least_coverage",
)
DRAWN = [name for name in SUBCOMMANDS if name not in {"report", "requirements", "video", *EXPORTS}]
NEEDS = {
    **{"transfer": "pair", "worst": "pair", "factors": "many", "power": "many"},
    "regression": "versions",
}
"""The study that a subcommand is drawn from, if it is not that of two runs."""
LARGE = {"power": [f"--difference={difference}" for difference in (2, 3, 4)]}
"""Differences that few replicates detect, whose power is soon computed."""
JOURNAL = "text.color: white\nfigure.facecolor: black\n"
JOURNAL += "font.size: 7\nfont.family: serif\nfigure.figsize: 3.4, 2.5\naxes.linewidth: 0.5\n"
LOOKS = {"column": ("", "1"), "page": ("", "2"), "journal": (JOURNAL, "1")}
"""A style and a width by name; no style turns pictures dark."""


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Study]:
    """The studies by name, each made when a figure first needs it."""
    top = tmp_path_factory.mktemp("figures")

    @cache
    def load(name: str) -> Study:
        make, *count = name.split()
        if make in BASES:
            load(BASES[make])
        MAKERS[make](top, *map(int, count))
        return load_study([top / name])

    return load


def make_study(top: Path) -> None:
    """Make runs, one with faults that grow and with controls."""
    drift = ("failure=random", "filter@failure.effect=drift", "failure.latest_s=3.0")
    back = "world.near.course.waypoints=[[1.0,1.2],[-1.0,1.2],[1.0,1.2]]"  # one place twice
    more = ("controls=all", "controls.trials=3", back)
    assert tiny(top / "study" / "drift", *drift, *SHOWN, *more) == DONE
    assert tiny(top / "study" / "spatial", "failure=spatial", *SHOWN) == DONE


def make_pair(top: Path) -> None:
    for failure in ("random", "spatial"):
        scored(top / "pair" / failure, top / "study", f"failure={failure}", "trials=2")


def make_versions(top: Path) -> None:
    for period in ("9.7", "4.0"):
        changed = f"controller.navigation.period_s={period}"
        scored(top / "versions" / period, top / "study", changed, "trials=2")


def make_many(top: Path) -> None:
    assert tiny(top / "many" / "0", "optimizer.generations=1") == DONE
    for seed in range(1, 12):
        levels = {"optimizer.population_size": 4 + seed % 2, "trials": 1 + seed // 2 % 2}
        scores = {"best_fitness": 3.0 + 0.1 * seed, "best_validated_fitness": 3.0 + seed % 5}
        vary(top / "many" / "0", top / "many" / str(seed), {**levels, "seed": seed}, scores)


def make_treatments(top: Path, count: int) -> None:
    for seed in range(2, 2 + 2 * count):
        place = top / f"treatments {count}" / str(seed)
        change = {"seed": seed, "optimizer.population_size": 4 + seed // 2}
        vary(top / "many" / "0", place, change, {"best_fitness": 3.0 + seed % 5})


MAKERS: dict[str, Callable[..., None]] = {
    "study": make_study,
    "pair": make_pair,
    "versions": make_versions,
    "many": make_many,
    "treatments": make_treatments,
}
BASES = {"pair": "study", "versions": "study", "treatments": "many"}
"""The study whose folders another one needs."""


@pytest.fixture(params=["column", "page", pytest.param("journal", marks=pytest.mark.slow)])
def look(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[list[str]]:
    style, columns = LOOKS[request.param]
    (tmp_path / "journal.mplstyle").write_text(style)
    with choose_style(str(tmp_path / "journal.mplstyle") if style else None):
        yield ["--columns", columns]


def draw(
    studies: Callable[[str], Study], name: str, options: list[str], wanted: str | None = None
) -> Figure:
    study = studies(wanted or NEEDS.get(name, "study"))
    given = parse([name, ".", *options, *LARGE.get(name, ())])
    product = make_product(import_subcommand(name), study, given)
    assert isinstance(product.figure, Figure)
    return product.figure


QUICK = ("overlay", "fitness", "mission", "compare", "strategies")


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(n, marks=pytest.mark.slow) for n in DRAWN if n not in QUICK)]
)
def test_it_can_be_read(name: str, studies: Callable[[str], Study], look: list[str]) -> None:
    figure = draw(studies, name, look)
    finish(figure)
    with use_style():
        assert find_faults(figure) == []
    assert {text.get_color() for text in texts(figure)}.isdisjoint({"white", "w"})
    assert figure.get_facecolor() == (1.0, 1.0, 1.0, 1.0)


def test_faults_of_text_are_found() -> None:
    figure = Figure(figsize=(2.0, 1.0))
    for place, word in (((0.3, 0.5), "under"), ((0.31, 0.52), "over"), ((0.9, 0.1), "leaves")):
        figure.text(*place, word)
    outside, on_text = find_faults(figure)
    assert outside.startswith("outside the figure")
    assert "'leaves'" in outside
    assert on_text == "text on text: 'under' and 'over'"


@pytest.mark.parametrize(
    "treatments", [*(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2)), 6]
)
@pytest.mark.parametrize("name", ["overlay", "panel", "strategies", "factors"])
def test_any_number_of_treatments_can_be_read(
    name: str, treatments: int, studies: Callable[[str], Study], look: list[str]
) -> None:
    if (name, treatments) == ("factors", 1):
        pytest.skip("nothing differs")
    figure = draw(studies, name, look, f"treatments {treatments}")
    finish(figure)
    with use_style():
        assert find_faults(figure) == []


@pytest.mark.parametrize(
    ("name", "first"), list(zip(["overlay", "mission", "strategies"], LETTERS, strict=True))
)
def test_each_panel_has_its_letter(name: str, first: str, studies: Callable[[str], Study]) -> None:
    figure = draw(studies, name, ["--columns", "2"])
    for _ in range(2):  # a figure that is saved again has no second letter
        finish(figure, letters=first)
    letters = [_find_letter(axes) for axes in list_panels(figure)]
    expected = [
        first.replace("a", chr(97 + i)).replace("A", chr(65 + i)) for i in range(len(letters))
    ]
    assert sorted(letters) == expected
    with use_style():
        assert find_faults(figure) == []


def _find_letter(axes: Axes) -> str:
    return axes.get_title(loc="left").split()[0]

"""Archives and fronts keep treatments apart, and runs if that is asked for."""

import argparse
import re

import pandas as pd
import pytest
from helpers import tiny, vary
from matplotlib.figure import Figure

from evoros.analysis.figures import archive, front
from evoros.analysis.figures.options import group_runs
from evoros.analysis.report.maps import make_maps
from evoros.analysis.report.page import collect_missions
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.study import Study
from evoros.terminal.console import DONE

SEEDS = (0, 1, 2)
MEASURES = (
    "+measure@descriptors.front=front_coverage",
    "+measure@descriptors.side=side_coverage",
    "+measure@objectives.fitness=fitness",
    "+measure@objectives.price=cost",
)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Two treatments of three runs each."""
    top = tmp_path_factory.mktemp("pooled")
    for failure in ("spatial", "random"):
        assert tiny(top / failure / "0", f"failure={failure}", *MEASURES) == DONE
        for seed in SEEDS[1:]:
            vary(top / failure / "0", top / failure / str(seed), {"seed": seed})
    return load_study([top])


def draw(name: str, study: Study, *options: str) -> tuple[Figure, pd.DataFrame]:
    module = {"archive": archive, "front": front}[name]
    chosen: argparse.Namespace = parse([name, ".", *options])
    product = module.make_product(study, chosen)
    assert isinstance(product.figure, Figure)
    assert product.table is not None
    return product.figure, product.table


def list_legends(figure: Figure) -> list[str]:
    legends = [*figure.legends, *(axes.legend_ for axes in figure.axes if axes.legend_)]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


@pytest.mark.slow
def test_a_cell_has_one_design_of_each_treatment(study: Study) -> None:
    figure, table = draw("archive", study)
    assert set(table.treatment) == {"spatial", "random"}
    assert not table.duplicated(["treatment", "cell_x", "cell_y"]).any()
    assert list_legends(figure) == list(study.treatments)  # and not a line for each run
    titles = [axes.get_title() for axes in figure.axes]
    assert [title for title in titles if title] == [
        f"{name}: best of {len(SEEDS)} runs" for name in study.treatments
    ]


def test_by_run_each_run_has_an_archive_in_the_colour_of_its_treatment(study: Study) -> None:
    figure, table = draw("archive", study, "--by", "run")
    assert set(table.run) == {record.name for record in study.records}
    assert not table.duplicated(["run", "cell_x", "cell_y"]).any()
    assert sum(bool(axes.get_title()) for axes in figure.axes) == len(study.records)
    assert list_legends(figure) == list(study.treatments)
    (growth,) = [axes for axes in figure.axes if axes.get_ylabel() == "coverage"]
    assert len(growth.lines) == len(study.records)
    assert len({line.get_color() for line in growth.lines}) == len(study.treatments)


def test_a_front_is_of_one_treatment_or_of_one_run(study: Study) -> None:
    for by in ("treatment", "run"):
        figure, table = draw("front", study, "--by", by)
        for _, rows in table.groupby(by):
            for row in rows.itertuples():  # dear and better, or cheap and worse
                assert not ((rows.x > row.x) & (rows.y < row.y)).any()
        assert list_legends(figure) == [
            "evaluated",
            *(f"{name} ({len(SEEDS)} runs)" for name in study.treatments),
        ]
        assert len(figure.axes[0].lines) == len(group_runs(study, by))


def test_axes_have_the_titles_and_units_of_the_measures(study: Study) -> None:
    figure, _ = draw("front", study)
    words = figure.axes[0].get_ylabel().replace("\n", " ")
    assert words == "price of the sensors [EUR] (lower is better)"
    fitness = study.records[0].context.fitness.label
    assert figure.axes[0].get_xlabel() == f"{fitness} (higher is better)"


@pytest.mark.slow
def test_the_maps_of_a_report_are_of_one_treatment_as_the_figures(study: Study) -> None:
    maps = make_maps(study, parse(["report", "."])).values()
    for name in ("archive", "front"):
        _, table = draw(name, study)
        shown = {made.title: made for made in maps if made.name == name}
        assert list(shown) == list(study.treatments)
        for treatment, rows in table.groupby("treatment"):
            made = shown[str(treatment)]
            drawn = [(record.name, design) for record, design in made.designs]
            assert drawn == list(zip(rows.run, rows.id, strict=True))
            assert made.runs == len(SEEDS)
        assert len({(made.low, made.high, str(made.ticks)) for made in shown.values()}) == 1
    assert len({made.key for made in maps}) == len(maps)


def test_a_report_names_the_treatment_of_each_map(study: Study) -> None:
    maps = make_maps(study, parse(["report", "."]))
    missions = collect_missions(maps, study, 1e5)
    page = "".join(missions.render(chosen) for chosen in maps.values())
    for treatment in study.treatments:
        assert page.count(f"<h3>{treatment}</h3>") == 2
        assert f'aria-label="Archive of {treatment}: ' in page
    for part in ("map", "designs"):
        keys = re.findall(f'data-{part}="([a-z]+-[0-9]+)"', page)
        assert len(set(keys)) == len(keys) == 4

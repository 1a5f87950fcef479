"""``evoros show``: what it lists of a design, wherever the design is recorded."""

from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Capture, Patch
from helpers import USER_PARTS, finished_run, refused

from evoros.analysis.tables.showing import find_shown_designs
from evoros.cli.main import evoros
from evoros.terminal.console import DONE

TABLE = ("--config-dir", str(USER_PARTS), "experiment=tiny")


def show(capsys: Capture, *arguments: object) -> str:
    """What is printed, without the first line, which names the source."""
    capsys.readouterr()
    assert evoros(["show", *map(str, arguments)]) == DONE
    return capsys.readouterr().out.partition("\n")[2]


@pytest.mark.slow
def test_a_design_is_the_same_wherever_it_is_recorded(tmp_path: Path, capsys: Capture) -> None:
    run = finished_run(tmp_path / "run")
    champion = pd.read_csv(run / "champion" / "design.csv")
    assert evoros(["archive", str(run), *TABLE[:2], "--output", str(tmp_path / "a.zip")]) == DONE
    shown = show(capsys, run)
    assert f"{len(champion)} sensors, total price" in shown
    assert show(capsys, run / "champion" / "design.csv", *TABLE) == shown
    assert show(capsys, run, "--design", champion.design[0]) == shown
    assert show(capsys, tmp_path / "a.zip") == shown


def test_poses_and_prices_are_those_of_the_design(tmp_path: Path) -> None:
    run = finished_run(tmp_path / "run", "design.sensors.sonar.price=2.5")
    champion = pd.read_csv(run / "champion" / "design.csv")
    (shown,) = find_shown_designs(run)
    place = shown.context.places[champion.link[0]]
    assert place[3] == 0.0  # the link is not rotated in this robot
    for axis, name in enumerate(("x_m", "y_m", "z_m")):
        assert (shown.sensors[name] - champion[name]).to_numpy() == pytest.approx(place[axis])
    assert list(shown.sensors.price) == [2.5] * len(champion)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--design", "x"], "--design x: must be the number of a design"),
        (["--design", "99999"], "--design 99999: no run or evaluation in"),
        (["experiment=tiny"], "experiment=tiny: applies only to a CSV file of designs"),
        (["--picture", "a.gif"], "--picture a.gif: must end in one of .png, .svg, .pdf"),
        (["--picture", "nix/a.png"], "--picture nix/a.png: the folder does not exist"),
        (["--picture", "a.png"], "--picture a.png: already exists; choose another file"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.png").touch()
    run = finished_run(tmp_path / "run")
    capsys.readouterr()  # the run's messages, if this test is the first to need it
    assert words in refused(lambda: evoros(["show", str(run), *arguments]), capsys)
    table = str(run / "champion" / "design.csv")
    refusal = refused(lambda: evoros(["show", table, *TABLE, "--design", "x"]), capsys)
    assert "--design x: not found; the designs are " in refusal
    refusal = refused(lambda: evoros(["show", "nix.csv", *TABLE]), capsys)
    assert "nix.csv: not found; give a CSV file of designs" in refusal


def test_a_picture_is_written_once(tmp_path: Path, capsys: Capture) -> None:
    run = finished_run(tmp_path / "run")
    for kind, start in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        picture = tmp_path / f"design.{kind}"
        assert f"picture: {picture}" in show(capsys, run, "--picture", picture)
        assert picture.read_bytes().startswith(start)

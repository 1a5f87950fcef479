"""What messages about a world propose can be typed, and helps."""

from pathlib import Path

import pytest
from fixture_types import Capture, Log, Patch
from proposal_sites import OVERRIDE, is_of, list_alternatives

from evoros.base.errors import InputError
from evoros.cli.inspect import inspect
from evoros.config.compose import compose
from evoros.terminal.console import DONE, INPUT

PLANE = "<geometry><plane><normal>{}</normal></plane></geometry>"
BOX = "<geometry><box><size>{}</size></box></geometry>"
WALK = (
    "<actor name='a'><script><trajectory id='0' type='walk'>"
    "<waypoint><time>0</time><pose>5 5 1 0 0 0</pose></waypoint>"
    "<waypoint><time>5</time><pose>9 5 1 0 0 0</pose></waypoint></trajectory></script></actor>"
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: Patch) -> Path:
    """An empty current folder; no pictures are drawn."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("evoros.analysis.drawing.worlds.draw_world_picture", lambda *_: b"\x89PNG")
    return tmp_path


def model(name: str, geometry: str, pose: str = "0 0 0 0 0 0") -> str:
    collision = f"<collision name='c'>{geometry}</collision>"
    link = f"<link name='l'>{collision}</link>"
    return f"<model name='{name}'><static>1</static><pose>{pose}</pose>{link}</model>"


def write_world(folder: Path, content: str) -> None:
    (folder / "w.sdf").write_text(f"<sdf version='1.6'><world name='w'>{content}</world></sdf>")


def inspected(name: str, *words: str) -> list[str]:
    """Type a command of inspect; ``world.NAME`` is the world of this name."""
    return ["world", "w.sdf", "--name", name, *(word.replace("NAME", name) for word in words)]


def build(*words: str) -> str:
    """Build a run in the file's world; return why it is refused, or nothing."""
    world = ("world=boxes", "world.boxes.sdf=w.sdf", "world.boxes.course.waypoints=[[2,0]]")
    try:
        compose([*world, "simulator=physics", *words]).build()
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("people", "words", "key"),
    [
        ("", ["walkers=people"], "evoros/world/crowds.py walkers=none"),
        (WALK, [], "evoros/world/crowds.py ++world.{name}.actors=leave_out"),
    ],
)
def test_nobody_walks_on_a_slope(folder: Path, people: str, words: list[str], key: str) -> None:
    write_world(folder, model("slope", PLANE.format("0.05 0 1")) + people)
    message = build(*words)
    assert message.startswith("walkers: world.boxes must have level ground")
    assert is_of(message, key)
    ((typed,),) = list_alternatives(message, {})
    kept = [word for word in words if not typed.startswith("walkers")]
    assert build(*kept, typed) == ""


@pytest.mark.parametrize("file", ["model://crate", "theirs/crate/model.sdf"])
def test_a_run_goes_without_missing_models_or_finds_them(folder: Path, file: str) -> None:
    crate = folder / "away" / file.removeprefix("model://").removesuffix("/model.sdf")
    crate.mkdir(parents=True)
    content = model("crate", BOX.format("1 1 1"))
    (crate / "model.sdf").write_text(f"<sdf version='1.6'>{content}</sdf>")
    write_world(folder, f"<include><uri>{file}</uri><pose>9 9 0 0 0 0</pose></include>")
    message = build()
    unnamed = message.replace("++world.boxes.", "world.NAME.")
    assert is_of(unnamed, "evoros/formats/sdf/reading.py world.NAME.model_paths")
    alternatives = list_alternatives(message, {"FOLDER": str(folder / "away")})
    assert len(alternatives) == 3
    for typed in alternatives:
        assert build(*typed) == ""


def test_one_of_several_worlds_is_chosen(folder: Path) -> None:
    block = model("block", BOX.format("1 1 1"), "5 5 0.5 0 0 0")
    worlds = "".join(f"<world name='{name}'>{block}</world>" for name in ("first", "second"))
    (folder / "w.sdf").write_text(f"<sdf version='1.6'>{worlds}</sdf>")
    message = build()
    unnamed = message.replace("++world.boxes.", "world.NAME.")
    assert is_of(unnamed, "evoros/formats/sdf/reader.py world.NAME.world_name=WORLD")
    (words,) = list_alternatives(message, {"WORLD": "second"})
    assert build(words[0]) == ""


@pytest.mark.parametrize("kind", ["vehicle", "actor"])
def test_a_note_of_a_run_proposes_keys_of_its_world(folder: Path, kind: str, caplog: Log) -> None:
    plugin = "<plugin filename='libdiff_drive.so' name='p'/></model>"
    vehicle = model("v", BOX.format("1 1 1"), "9 9 0.5 0 0 0").replace("</model>", plugin)
    vehicle = vehicle.replace("<static>1</static>", "")
    write_world(folder, vehicle if kind == "vehicle" else WALK)
    assert build("++world.boxes.actors=leave_out") == ""
    (note,) = [text for text in caplog.messages if "++world.boxes." in text]
    ((key, value),) = OVERRIDE.findall(note)
    caplog.clear()
    assert build(f"{key}={value}") == ""
    assert "is left out" not in caplog.text


def test_a_course_is_given_where_a_home_has_no_room(folder: Path, capsys: Capture) -> None:
    walls = ((0, -0.4, "1 0.1"), (0, 0.4, "1 0.1"), (-0.4, 0, "0.1 1"), (0.4, 0, "0.1 1"))
    posts = [
        model(f"wall{x}{y}", BOX.format(f"{size} 1"), f"{x} {y} 0.5 0 0 0") for x, y, size in walls
    ]
    write_world(folder, model("floor", PLANE.format("0 0 1")) + "".join(posts))
    assert inspect(inspected("a", "course.home_x_m=0", "course.home_y_m=0")) == INPUT
    message = capsys.readouterr().err
    assert is_of(message, "evoros/session/course_planning.py {x}=X")
    given = {"=X": "=5", "=Y": "=0", "[[X, Y], ...]": "[[8,0]]", ".a.": ".b."}
    (words,) = list_alternatives(message, given)
    assert inspect(inspected("b", *words)) == DONE


@pytest.mark.slow
def test_a_course_has_keys(folder: Path, capsys: Capture) -> None:
    write_world(folder, model("block", BOX.format("1 1 1"), "5 5 0.5 0 0 0"))
    assert inspect(inspected("a", "world.NAME.course=1")) == INPUT
    message = capsys.readouterr().err
    assert is_of(message, "evoros/session/course_planning.py world.NAME.course.home_x_m=1")
    typed = message.partition("such as ")[2].partition(",")[0].replace(".a.", ".b.")
    assert inspect(inspected("b", typed)) == DONE


@pytest.mark.slow
def test_models_of_a_folder_can_be_met(folder: Path, capsys: Capture) -> None:
    (folder / "theirs" / "crate").mkdir(parents=True)
    crate = model("crate", BOX.format("1 1 1"))
    (folder / "theirs/crate/model.sdf").write_text(f"<sdf version='1.6'>{crate}</sdf>")
    (folder / "theirs/crate/model.config").write_text(
        "<model><name>crate</name><sdf version='1.6'>model.sdf</sdf></model>"
    )
    write_world(folder, "<include><uri>model://crate</uri><pose>3 3 0 0 0 0</pose></include>")
    key = "evoros/session/inspection.py world.NAME.model_paths"
    absent = "world.NAME.missing=leave_out"
    assert inspect(inspected("a", absent)) == DONE
    message = " ".join(capsys.readouterr().out.split())
    assert is_of(message, key)
    typed = "world.NAME.model_paths=[theirs]"
    assert typed.replace("NAME", "a").replace("theirs", "FOLDER") in message
    assert inspect(inspected("b", absent, typed)) == DONE
    assert not is_of(capsys.readouterr().out, key)

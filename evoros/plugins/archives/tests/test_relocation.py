"""Paths of a machine in texts become paths in an archive, and no other text changes."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.files.reads import collect_reads, note_read
from evoros.plugins.archives.layout import Layout
from evoros.storage.archives import NOWHERE, Relocation

PLACES = Relocation({"/home/me": "~", "/home/me/work": ".", "/home/me/my parts": "../parts"})


@pytest.mark.parametrize(
    ("text", "moved"),
    [
        ("/home/me/work/a.urdf", "a.urdf"),
        ("/home/me/work", "."),
        ("[/home/me/work, /home/me]", "[., ~]"),
        ('filename="file:///home/me/work/m/a.stl"', 'filename="file://m/a.stl"'),
        ("/home/me/my parts/a.yaml: line 1", "../parts/a.yaml: line 1"),
        ("/home/me/works/a", "~/works/a"),
        ("/home/me/work.old/a", "~/work.old/a"),
        ("/home/menu/a", "/home/menu/a"),
        ("x/home/me/a", "x/home/me/a"),
        ("see /home/me/work.", "see .."),
    ],
)
def test_a_path_is_replaced_as_a_whole(text: str, moved: str) -> None:
    assert PLACES.relocate(text) == moved
    assert PLACES.relocate_bytes(b"\xff" + b" " + text.encode()) == b"\xff " + moved.encode()


@given(st.text())
def test_other_texts_stay(text: str) -> None:
    assert NOWHERE.relocate(text) == text
    if "/home/me" not in text:
        assert PLACES.relocate(text) == text


NAMES = st.lists(st.sampled_from("abc"), min_size=1, max_size=4).map("/".join)


@given(st.lists(NAMES, min_size=1, max_size=4), NAMES, NAMES)
def test_files_lie_to_each_other_as_before(folders: list[str], one: str, other: str) -> None:
    import os

    paths = [Path("/top") / folder for folder in folders]
    layout = Layout.around(paths, Path("/home/me"))
    first, second = paths[0] / one, paths[-1] / other
    before = os.path.relpath(second, first)
    assert os.path.relpath(layout.place(second), layout.place(first)) == before


def test_no_place_names_the_user() -> None:
    layout = Layout.around([Path("/home/me/work"), Path("/opt/work"), Path("/opt/a/b")], HOME)
    places = layout.places.values()
    assert not any("me" in place.split("/") for place in places)
    assert len(set(places)) == 3
    assert all(place.startswith("inputs/") for place in places)


HOME = Path("/home/me")


def test_files_that_are_read_are_collected(tmp_path: Path) -> None:
    (tmp_path / "read").write_text("x")
    with collect_reads() as paths:
        (tmp_path / "read").read_text()
        (tmp_path / "written").write_text("x")
        note_read([str(tmp_path / "by another")])
    (tmp_path / "written").read_text()
    names = {path.name for path in paths if path.parent == tmp_path}
    assert names == {"read", "by another"}

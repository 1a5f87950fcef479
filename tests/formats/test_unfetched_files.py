"""Files that were not fetched: a pointer of Git LFS, or a page of the site that has the file."""

from collections.abc import Callable
from pathlib import Path

import pytest

from evoros.base.errors import InputError
from evoros.drive.automatic import AutomaticDescription
from evoros.formats.mesh_files import read_content
from evoros.formats.sdf.reading import SdfOptions
from evoros.robot.loading import load_robot
from evoros.session.design_tables import read_rows
from evoros.world.loading import read_world

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
CONTENT = {
    POINTER: "only a Git LFS pointer to the file; type git lfs pull",
    "\n<!DOCTYPE html>\n<html><body>404</body></html>\n": "a web page in place of the file",
}
READERS: dict[str, Callable[[Path], object]] = {
    "r.urdf": lambda file: load_robot(str(file), AutomaticDescription()),
    "r.xacro": lambda file: load_robot(str(file), AutomaticDescription()),
    "w.sdf": lambda file: read_world(str(file), SdfOptions(), {}),
    "d.csv": lambda file: list(read_rows(file, ["design"], [])),
    "m.stl": read_content,
    "m.dae": read_content,
}


@pytest.mark.parametrize("content", CONTENT, ids=["pointer", "page"])
@pytest.mark.parametrize("name", READERS)
def test_what_stands_in_place_of_a_file_is_named(name: str, content: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(InputError) as caught:
        READERS[name](file)
    assert f"{file}: {CONTENT[content]}" in str(caught.value)

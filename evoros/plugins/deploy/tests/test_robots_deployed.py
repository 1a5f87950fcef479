"""A package of each robot of a run with two."""

from pathlib import Path

import pytest
from two_robots import draw, load_two


@pytest.mark.slow
def test_a_package_is_of_the_named_robot(tmp_path: Path) -> None:
    study = load_two(tmp_path)
    (record,) = study.records
    product = draw(study, "deploy", "--agent", "oncoming")
    assert product.folder.endswith("_oncoming_champion")
    (urdf,) = (content for path, content in product.files.items() if path.endswith(".urdf"))
    kept = (record.path / "champion" / "agents" / "oncoming" / "robot.urdf").read_bytes()
    first = (record.path / "champion" / "robot.urdf").read_bytes()
    joint = b'<joint name="sonar_0'
    place = [text[text.index(joint) :][:400] for text in (urdf, kept, first)]
    assert place[0] == place[1] != place[2]

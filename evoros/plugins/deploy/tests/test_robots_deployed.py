"""A package of each robot of a run with two."""

import pytest
from helpers import finished_run
from two_robots import TWO, draw

from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A run in which the second robot has a design of its own."""
    return load_study([finished_run(tmp_path_factory.mktemp("two") / "run", *TWO)])


@pytest.fixture(scope="module")
def record(study: Study) -> Record:
    return study.records[0]


@pytest.mark.slow
def test_a_package_is_of_the_named_robot(study: Study, record: Record) -> None:
    product = draw(study, "deploy", "--agent", "oncoming")
    assert product.folder.endswith("_oncoming_champion")
    (urdf,) = (content for path, content in product.files.items() if path.endswith(".urdf"))
    kept = (record.path / "champion" / "agents" / "oncoming" / "robot.urdf").read_bytes()
    first = (record.path / "champion" / "robot.urdf").read_bytes()
    joint = b'<joint name="sonar_0'
    place = [text[text.index(joint) :][:400] for text in (urdf, kept, first)]
    assert place[0] == place[1] != place[2]

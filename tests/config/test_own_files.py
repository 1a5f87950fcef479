"""The YAML files of robots and worlds of the user's own."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.own_files import ROBOT, WORLD, OwnFile, choose_name, parse_keys

scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
values = st.dictionaries(
    st.from_regex(r"[a-z]{1,8}", fullmatch=True),
    scalars | st.lists(scalars) | st.dictionaries(st.sampled_from(["a", "b"]), scalars),
    min_size=1,
)


@given(values)
def test_the_text_of_a_robot_gives_its_values_back(given_values: dict[str, Any]) -> None:
    content = yaml.safe_load(OwnFile(ROBOT, "scout", "A scout.", given_values).text)
    assert content.pop("defaults") == ["own", "_self_"]
    assert content == given_values


@given(values)
def test_the_text_of_a_world_gives_its_values_back(given_values: dict[str, Any]) -> None:
    content = yaml.safe_load(OwnFile(WORLD, "depot", "A depot.", given_values).text)
    assert content["depot"].pop("_target_") == "evoros.world.loading.load_world"
    assert content == {"depot": given_values}


def test_keys_are_nested_and_typed_as_in_yaml() -> None:
    words = ["arguments.laser=true", "arguments.x=0.3", "packages=[a, b]", "name=a b"]
    expected = {"arguments": {"laser": True, "x": 0.3}, "packages": ["a", "b"], "name": "a b"}
    assert parse_keys(words) == expected


@pytest.mark.parametrize("words", [["laser"], ["=3"], ["a=[1"], ["a=1", "a.b=2"]])
def test_a_malformed_key_is_refused(words: list[str]) -> None:
    with pytest.raises(InputError, match=r"must|already"):
        parse_keys(words)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("turtle.urdf.xacro", "turtle"),
        ("My Depot-2.world", "my_depot_2"),
        ("scout/model.sdf", "scout"),
        ("3wheels.urdf", "my_3wheels"),
        ("mule.xacro", "my_mule"),
    ],
)
def test_parts_are_named_after_their_files(file: str, name: str) -> None:
    assert choose_name(Path(file), ROBOT) == name

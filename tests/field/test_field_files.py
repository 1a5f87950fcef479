"""Files of generated worlds: the same bytes again, and a comment that is enough for them."""

import subprocess
import sys

import pytest
from field_cases import CRATES, field, fields, noted
from hypothesis import given, settings

from evoros.config.compose import compose
from evoros.field.drawn import FIXED
from evoros.field.generated import Field
from evoros.field.obstacles import Box
from evoros.files.resources import bundled_folder
from evoros.formats.sdf.reader import read_sdf
from evoros.world.model import World


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_in_another_process() -> None:
    code = (
        "from evoros.config.compose import compose\n"
        "experiment = compose(['world=generated', 'executor=serial']).build()\n"
        "print(experiment.world['generated'].sdf, end='')"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={}
    )
    here = compose(["world=generated", "executor=serial"]).build().world["generated"]
    assert other.stdout == here.sdf


def test_every_seed_and_every_key_of_draws_gives_another_field() -> None:
    made = [
        field(seed=seed).draw_world(draws).source_sha256 for seed in (0, 1) for draws in ("a", "b")
    ]
    assert len(set(made)) == 4
    assert field().draw_world("a") is field().draw_world("a")  # kept, not drawn again


@settings(max_examples=10, deadline=None)
@given(fields())
def test_the_file_is_the_world_in_every_bit(one: Field) -> None:
    world = one.draw_world(FIXED)
    assert read_sdf(world.sdf.encode(), "a file").bodies == world.bodies
    again = World("generated", read_sdf(world.sdf.encode(), "a file").bodies, one.course, "x", "y")
    assert again.sdf == world.sdf.replace(f"<!-- {world.note} -->\n", "")


def test_the_comment_is_enough_to_make_the_file_again() -> None:
    for one, draws in ((field(kinds={"a--b": CRATES}), "0/selection/3/x--y/1"), (field(), FIXED)):
        sdf = one.draw_world(draws).sdf
        made, key = noted(sdf)
        assert (made, key) == (one, draws)
        assert made.draw_world(key).sdf == sdf


def test_the_comment_does_not_name_the_place_of_a_class() -> None:
    moved = type("Box", (Box,), {"__module__": "elsewhere"})
    one = field(kinds={"crates": moved(**vars(CRATES))})
    assert one.draw_world(FIXED).sdf == field(kinds={"crates": CRATES}).draw_world(FIXED).sdf


DENSE = ("dense_crates", "dense_barrels", "dense_mixed")


@pytest.mark.parametrize("name", DENSE)
def test_the_dense_fields_are_what_their_comments_say(name: str) -> None:
    content = (bundled_folder("worlds") / f"{name}.sdf").read_text()
    made, draws = noted(content)
    drawn = made.draw_world(draws)
    assert drawn.sdf == content
    experiment = compose(["world=dense"]).build()
    assert tuple(experiment.world) == DENSE
    assert experiment.world[name].bodies == drawn.bodies

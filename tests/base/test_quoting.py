"""What a message proposes to type reaches evoros as it was meant, through a shell and Hydra."""

import os
import subprocess

from hypothesis import example, given
from hypothesis import strategies as st

from evoros.base.errors import override, shell_line, single_line
from evoros.config.compose import parse

names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
awkward = st.sampled_from(
    ["x=1,2 ä#%", "a  b", " a", "it's", 'say "so"', "\\", 'a\\"', "~", "[1,2]", "{a: b}", "null"]
)


@given(names | awkward | st.integers() | st.booleans() | st.none() | st.lists(awkward))
def test_a_value_is_read_by_hydra_as_it_was_meant(value: object) -> None:
    (read,) = parse([override("like", value)])
    assert read.value() == value
    assert type(read.value()) is type(value)


@given(st.lists(names | awkward, min_size=1, max_size=3))
@example([os.fsdecode(b"\xffab")])
@example(["tab\there\n"])
def test_a_line_gives_a_program_its_words_after_it_was_printed(words: list[str]) -> None:
    printed = single_line(shell_line("printf", r"%s\0", *words))
    done = subprocess.run(["bash", "-c", printed], capture_output=True, check=True)
    assert done.stdout.split(b"\0")[:-1] == [os.fsencode(word) for word in words]

"""A run folder finds every mission again and keeps those of one generation in memory."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from evoros.mission.mission import MissionKey, Outcome
from evoros.storage.mission_table import MissionRows, Recorded

KEYS = st.tuples(st.integers(0, 4), st.integers(0, 3), st.sampled_from("ab"), st.integers(0, 1))
BLANK = Outcome.failure("lost", "", 1.0, 0)


@given(st.lists(KEYS, unique=True), st.lists(KEYS), st.data())
def test_every_mission_is_found_again_in_any_order(
    keys: list[MissionKey], asked: list[MissionKey], data: st.DataObject
) -> None:
    table: list[Recorded] = [
        (key, f"draws {i}", (replace(BLANK, visited=i),)) for i, key in enumerate(keys)
    ]
    reads: list[int] = []

    def read(place: int) -> Recorded:
        reads.append(place)
        return table[place]

    rows = MissionRows(read)
    known = data.draw(st.integers(0, len(keys)))
    for place, key in enumerate(keys[:known]):
        rows.note(key, place)
    for place in range(known, len(keys)):
        rows.find(data.draw(KEYS))  # another generation may be in use while one is added
        rows.add([table[place]], [place])
    assert len(rows) == len(keys)
    assert rows.worlds == {world for _, _, world, _ in keys}
    for key in [*keys, *asked]:
        wanted = [row[1:] for row in table if row[0] == key]
        assert rows.find(key) == (wanted[0] if wanted else None)
        reads.clear()
        rows.find(key)  # again: its generation is in memory
        assert not reads

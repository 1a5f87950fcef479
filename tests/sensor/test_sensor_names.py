"""The names of mounted sensors are free, and the links of a whole robot tell which they are."""

from hypothesis import given
from hypothesis import strategies as st

from evoros.sensor.protocol import choose_prefix, find_prefix

TYPES = ("sonar", "imu", "sonar_wide")
taken = st.sets(
    st.builds(
        "{}{}_{}{}".format,
        st.sampled_from(["", "evoros_", "evoros_evoros_", "my_"]),
        st.sampled_from(["sonar", "imu", "sonar_wide", "lidar"]),
        st.integers(0, 12),
        st.sampled_from(["", "_joint"]),
    )
)


@given(taken, st.lists(st.sampled_from(TYPES), min_size=1, max_size=5))
def test_names_are_free_and_found_again(robot: set[str], mounted: list[str]) -> None:
    prefix = choose_prefix(robot, TYPES)
    links = {f"{prefix}{kind}_{index}" for index, kind in enumerate(mounted)}
    joints = {f"{link}_joint" for link in links}
    assert not (links | joints) & robot
    assert find_prefix(robot | links, TYPES) == prefix
    others = {name for name in robot if name.startswith(prefix)} - links
    assert not any(f"{prefix}{kind}_{index}" in others for kind in TYPES for index in range(13))


def test_a_robot_without_such_names_keeps_short_ones() -> None:
    names = ("base_link", "sonar", "sonar_link", "sonar_0_mount", "my_sonar_0")
    assert choose_prefix(names, TYPES) == ""
    assert choose_prefix((), ()) == ""

import re

from hypothesis import given
from hypothesis import strategies as st

from evoros.config.compose import MAX_LENGTH, job_name


@given(st.lists(st.text(max_size=60), max_size=8))
def test_any_override_gives_a_name_that_is_one_safe_component(overrides: list[str]) -> None:
    name = job_name(overrides)
    assert re.fullmatch(r"[A-Za-z0-9._+-]+", name)
    assert name not in (".", "..")
    assert len(name) <= MAX_LENGTH + 9


def test_names_are_readable() -> None:
    assert job_name(["failure=random", "seed=0"]) == "failure-random_seed-0"
    assert job_name(["controller.avoidance.range_m=1.5"]) == "range_m-1.5"
    assert job_name(["world/course@boxes.course=square"]) == "course-square"
    assert job_name(["+a.b=[1,2]", "~failure"]) == "b-1-2_failure"
    assert job_name([]) == "baseline"


def test_a_path_is_named_by_its_end_and_stays_different() -> None:
    paths = [f"/home/me/outputs/{study}/run" for study in ("a", "b")]
    names = [job_name([f"designs={path}", "seed=0"]) for path in (*paths, "[x/a.csv,y/b/]")]
    for name, end in zip(names, ("run", "run", "a.csv-b"), strict=True):
        assert re.fullmatch(f"designs-{end}-[0-9a-f]{{6}}_seed-0", name)
    assert len(set(names)) == 3
    assert job_name(["designs=designs.csv"]) == "designs-designs.csv"


def test_long_names_that_differ_only_at_the_end_stay_different() -> None:
    first, second = (job_name(["key=" + "x" * 300 + end]) for end in "ab")
    assert first != second

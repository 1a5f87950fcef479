"""A mission has a core of its own, with all that it starts, for as long as it lasts."""

import os
import subprocess
import sys
import uuid
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from evoros.plugins.ardupilot.sitl import share_core

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="cores are claimed on Linux only")


@pytest.fixture
def allowed(monkeypatch: pytest.MonkeyPatch) -> Iterator[set[int]]:
    """The cores of this thread, at least two, of which no other test has claimed any."""
    monkeypatch.setattr("evoros.plugins.ardupilot.sitl.CLAIM", f"\0{uuid.uuid4()} {{}}")
    cores = os.sched_getaffinity(0)
    if len(cores) < 2:
        pytest.skip("there is one core")
    yield cores
    assert os.sched_getaffinity(0) == cores


def started_cores() -> set[int]:
    code = "import os; print(*os.sched_getaffinity(0))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(map(int, done.stdout.split()))


def test_a_process_that_is_started_has_the_same_core(allowed: set[int]) -> None:
    with share_core():
        cores = os.sched_getaffinity(0)
        assert len(cores) == 1
        assert cores < allowed
        assert started_cores() == cores


def test_each_has_a_core_of_its_own_until_none_is_left(allowed: set[int]) -> None:
    met: list[int] = []
    with ExitStack() as stack:
        for _ in allowed:
            stack.enter_context(share_core())
            met += os.sched_getaffinity(0)
            os.sched_setaffinity(0, allowed)  # as another worker
        assert sorted(met) == sorted(allowed)
        with share_core():
            assert os.sched_getaffinity(0) == allowed
    with share_core():
        assert os.sched_getaffinity(0) < allowed


def test_an_error_gives_the_core_back(allowed: set[int]) -> None:
    with pytest.raises(ZeroDivisionError), share_core():
        raise ZeroDivisionError
    assert os.sched_getaffinity(0) == allowed
    with share_core():
        assert len(os.sched_getaffinity(0)) == 1


def test_it_may_be_unwanted(allowed: set[int]) -> None:
    with share_core(wanted=False):
        assert os.sched_getaffinity(0) == allowed


def test_one_core_is_kept_as_it_is(allowed: set[int]) -> None:
    core = max(allowed)
    os.sched_setaffinity(0, {core})
    try:
        with share_core():
            assert os.sched_getaffinity(0) == {core}
        assert os.sched_getaffinity(0) == {core}
    finally:
        os.sched_setaffinity(0, allowed)

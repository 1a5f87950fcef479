import re
from types import SimpleNamespace
from typing import Any

import pytest

from evoros.outcome import Outcome
from evoros.progress import Progress

FLOWN: Any = Outcome.failure("time_limit", "", 10.0, 0)


def after(generations: int, flown: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """The line when so many missions are flown, ten in each generation, a second each."""
    now = [0.0]
    monkeypatch.setattr("evoros.progress.time.monotonic", lambda: now[0])
    display = Progress(live=False)
    display.start(generations)
    for number in range(flown):
        if number % 10 == 0:
            display.begin(number // 10, 8, 0)
        if number % 10 == 8:
            display.begin(number // 10, 2, 0)  # the validation
        now[0] += 1.0
        display.mission(None, FLOWN)  # type: ignore[arg-type]
        if number % 10 == 9:
            best = SimpleNamespace(fitness=1.0)
            state = SimpleNamespace(best=best, validated=None, mean=0.5, number=number // 10)
            display.generation(state)  # type: ignore[arg-type]
    return display.line()


@pytest.mark.parametrize("flown", [10, 15, 20, 28, 39])
def test_the_time_left_is_right_where_all_generations_are_alike(
    flown: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = re.search(r"0:(\d\d):(\d\d) left", after(4, flown, monkeypatch))
    assert found
    left = 60 * int(found[1]) + int(found[2])
    validation = 2 if flown % 10 in range(1, 9) else 0  # is not known of before it begins
    assert left == 40 - flown - validation


def test_nothing_is_promised_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "left" not in after(4, 0, monkeypatch)
    assert after(4, 1, monkeypatch).startswith("generation 0/3 | missions 1/8 | ")

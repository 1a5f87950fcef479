"""Parts of several runs that wait at the same moment become one call."""

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any

import pytest

from evoros.executor.protocol import ALONE, Shared
from evoros.plugins.gpu.executor import GpuBatches, Joining, Part

BATCHES, SHARED = GpuBatches("cpu", 8, "cpu"), Shared.of(b"scenario")


class Calls:
    """A pool whose calls end when a test says so."""

    shares_files = True

    def __init__(self, workers: int = 1) -> None:
        self.workers = workers
        self.asked: list[list[str]] = []
        self.futures: list[Future[Any]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        batches, asked, *shared = args
        assert (batches, shared) == (BATCHES, [SHARED] * len(asked))
        self.asked.append(asked)
        self.futures.append(Future())
        return self.futures[-1]


def part(run: str, text: str, share: float = 0.1) -> Part:
    return Part(lambda: None, RUNS[run], share, SHARED, text)


RUNS = {name: object() for name in "abcd"}


def test_parts_that_wait_are_one_call_with_one_of_each_run() -> None:
    pool = Calls()
    joining = Joining(pool, BATCHES)
    parts = [part("a", "a1"), part("a", "a2"), part("b", "b1"), part("a", "a3"), part("c", "c1")]
    futures = [joining.add(one) for one in parts]
    assert pool.asked == [["a1"]]
    pool.futures[0].set_result(["A1"])
    assert pool.asked == [["a1"], ["a2", "b1", "c1"]]
    pool.futures[1].set_result(["A2", "B1", "C1"])
    pool.futures[2].set_result(["A3"])
    assert [future.result(0) for future in futures] == ["A1", "A2", "B1", "A3", "C1"]


def test_each_worker_has_a_call_and_none_has_more_than_a_whole_one() -> None:
    pool = Calls(workers=2)
    joining = Joining(pool, BATCHES)
    for one in (part("a", "a1", 0.6), part("b", "b1", 0.6), part("a", "a2", 0.6)):
        joining.add(one)
    joining.add(part("b", "b2", 0.6))
    joining.add(part("c", "c1", 0.4))
    joining.add(part("d", "d1", ALONE))
    assert pool.asked == [["a1"], ["b1"]]
    pool.futures[1].set_result(["B1"])
    assert pool.asked[2:] == [["a2", "c1"]]
    pool.futures[0].set_result(["A1"])
    pool.futures[3].set_result(["B2"])
    assert pool.asked[3:] == [["b2"], ["d1"]]


def test_an_error_is_that_of_the_run_whose_part_fails_alone() -> None:
    pool = Calls()
    joining = Joining(pool, BATCHES)
    first, *futures = [joining.add(part(run, run)) for run in "abc"]
    pool.futures[0].set_result(["A"])
    pool.futures[1].set_exception(ValueError("of one of them"))
    assert pool.asked[2:] == [["b"], ["c"]]
    error = ValueError("of b")
    pool.futures[2].set_exception(error)
    pool.futures[3].set_result(["C"])
    assert first.result(0) == "A"
    assert futures[0].exception(0) is error
    assert futures[1].result(0) == "C"
    joining.add(part("a", "again"))
    assert pool.asked[-1] == ["again"]


def test_what_a_pool_refuses_is_the_error_of_the_part(monkeypatch: pytest.MonkeyPatch) -> None:
    pool = Calls()

    def refuse(function: Any, /, *args: Any) -> Any:
        raise ValueError("does not pickle")

    monkeypatch.setattr(pool, "submit", refuse)
    with pytest.raises(ValueError, match="does not pickle"):
        Joining(pool, BATCHES).add(part("a", "a")).result(0)


def test_what_waits_at_the_end_is_cancelled() -> None:
    pool = Calls()
    joining = Joining(pool, BATCHES)
    flying, waiting = joining.add(part("a", "a")), joining.add(part("b", "b"))
    joining.close()
    assert waiting.cancelled()
    pool.futures[0].set_exception(CancelledError())
    assert isinstance(flying.exception(0), CancelledError)
    assert len(pool.asked) == 1
    with pytest.raises(RuntimeError, match="closed"):
        joining.add(part("a", "late"))


def test_parts_of_many_threads_are_all_answered() -> None:
    pool = Calls(workers=2)
    joining = Joining(pool, BATCHES)
    answered = [0]

    def ask(run: str) -> None:
        for k in range(50):
            joining.add(part(run, f"{run}{k}", 0.3)).add_done_callback(lambda future: count(future))

    def count(future: "Future[Any]") -> None:
        answered[0] += future.result(0).isupper()

    threads = [threading.Thread(target=ask, args=(run,)) for run in RUNS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for call, asked in zip(pool.futures, pool.asked, strict=False):  # both grow meanwhile
        call.set_result([text.upper() for text in asked])
    assert answered == [50 * len(RUNS)]
    assert len(pool.asked) < answered[0]

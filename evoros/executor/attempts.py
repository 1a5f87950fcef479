"""Attempts at a call in a worker process, whichever executor the process belongs to."""

import pickle
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from evoros.base.checks import MOST, Rule, is_whole
from evoros.base.errors import WorkerLost
from evoros.executor.payload import PILOT_LOST, RAISED, RETURNED, Answer, Call
from evoros.executor.worker_handle import NoAnswerError, Worker


def null_or_whole(minimum: int) -> Rule:
    """The rule for a number that may be left out."""
    return Rule(
        f"a whole number of at least {minimum}, or null",
        lambda v: v is None or (is_whole(v) and v >= minimum),
        limit=MOST,
    )


@dataclass(frozen=True)
class Limits:
    """What every executor with worker processes offers; see the fields of ``Processes``."""

    time_limit_s: float
    retries: int
    calls_per_worker: int | None

    def start_worker(self, closing: "Future[None]", folders: Sequence[str] = ()) -> Worker:
        """Return the handle on a worker process, which starts at its first call.

        It imports from ``folders`` first.
        """
        return Worker(closing, self.time_limit_s, self.calls_per_worker, folders)

    def attempt(self, call: Call, worker: Worker) -> Answer:
        """Attempt the call until it is answered, as often as the settings allow.

        Raises:
            CancelledError: the pool is being closed.
        """
        attempts = self.retries + 1
        for left in reversed(range(attempts)):
            try:
                answer = worker.answer(call)
            except NoAnswerError as error:
                if not left:
                    times = "once" if attempts == 1 else f"{attempts} times, the last time"
                    lost = f"{call.name}: lost {times} because {error.reason}; {error.fix}"
                    return Answer(RAISED, pickle.dumps(WorkerLost(lost)))
                continue
            if answer.kind != PILOT_LOST:
                break
        return answer


def settle(future: "Future[Any]", answer: Answer) -> None:
    """Give a future its result or exception."""
    try:
        value = pickle.loads(answer.content)
    except BaseException as error:  # for the caller; the thread must go on
        future.set_exception(error)
        return
    if answer.kind == RETURNED:
        future.set_result(value)
    else:
        future.set_exception(value)

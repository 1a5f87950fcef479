"""Attempts at a call in a worker process, whichever executor the process belongs to."""

import pickle
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Annotated, Any

from evoros.base.checks import MOST, POSITIVE, WHOLE, Rule, checked, is_whole
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


@dataclass(frozen=True, kw_only=True)
@checked
class Limits:
    """The limits of calls, of every executor with worker processes."""

    time_limit_s: Annotated[float, POSITIVE] = 600.0  # wall clock, of one attempt at one call
    retries: Annotated[int, WHOLE] = 1  # at a call that crashed, hung or raised PilotLost
    calls_per_worker: Annotated[int | None, null_or_whole(1)] = None
    """Calls until a fresh process takes over; None: no limit."""

    def attempt(self, call: Call, worker: Worker) -> Answer:
        """Attempt the call until it is answered, as often as the settings allow.

        Raises:
            CancelledError: the pool is being closed.
        """
        attempts = self.retries + 1
        for _ in range(attempts):
            try:
                answer = worker.answer(call)
            except NoAnswerError as error:
                times = "once" if attempts == 1 else f"{attempts} times, the last time"
                lost = f"{call.name}: lost {times} because {error.reason}; {error.fix}"
                answer = Answer(RAISED, pickle.dumps(WorkerLost(lost)))
            else:
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

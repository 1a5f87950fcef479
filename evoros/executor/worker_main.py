"""What happens inside a worker process of ``Processes``."""

import fcntl
import os
import pickle
import signal
import sys
import traceback
from multiprocessing import connection, parent_process
from threading import Thread
from types import FrameType

from evoros.base.errors import EvorosError


def prepare() -> int:
    """The first call in a worker: see to it that the process can be ended. Returns its id.

    It leads a process group, so that what a call has started (an autopilot) ends with it.
    """
    os.setpgid(0, 0)
    # The default action needs no interpreter: it also ends C code that never returns.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # Ctrl-C is the main process's. A handler, unlike SIG_IGN and a blocked signal, is not passed
    # on to programs that a call starts, some of which are to be ended by SIGINT.
    signal.signal(signal.SIGINT, _do_nothing)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    _end_with_main_process()
    return os.getpid()


def perform(payload: bytes) -> bytes:
    """Make the pickled call; the pickled answer is (True, result) or (False, exception).

    Pickled here and not by the pool: a class that this process cannot import, or an exception
    that cannot be rebuilt, is then an error of this one call.
    """
    returned = True
    try:
        function, args = pickle.loads(payload)
        value = function(*args)
    except BaseException as error:
        # The traceback itself does not pickle; a note is printed with the main process's.
        error.add_note(f"In the worker process:\n{traceback.format_exc()}")
        returned, value = False, error
    try:
        answer = pickle.dumps((returned, value))
        if not returned:
            pickle.loads(answer)  # fails where __init__ wants more than the exception's args
        return answer
    except Exception as problem:
        return pickle.dumps((False, _unpicklable(value, problem)))


def _do_nothing(number: int, frame: FrameType | None) -> None:
    pass


def _unpicklable(value: object, problem: Exception) -> EvorosError:
    error = EvorosError(
        f"{type(value).__name__}: {value}; this cannot be sent back from the worker process as "
        f"it is ({problem}); return or raise what pickles, or use executor=serial"
    )
    for note in getattr(value, "__notes__", ()):
        error.add_note(note)
    return error


def _end_with_main_process() -> None:
    """Be killed as soon as the main process is gone, whatever ended it and whatever runs here."""
    main = parent_process()
    assert main is not None, "not a worker process"
    sentinel = main.sentinel  # a pipe, whose other end only the main process has
    if sys.platform == "linux":
        # The kernel kills the group when the other end closes, even amid C code without end.
        fcntl.fcntl(sentinel, fcntl.F_SETOWN, -os.getpid())
        fcntl.fcntl(sentinel, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(sentinel, fcntl.F_GETFL)
        fcntl.fcntl(sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)
    # Other systems, and a main process that was gone before.
    Thread(target=_kill_group_after, args=(sentinel,), daemon=True).start()


def _kill_group_after(sentinel: int) -> None:
    connection.wait([sentinel])
    os.killpg(0, signal.SIGKILL)

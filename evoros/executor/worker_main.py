"""Code executed in worker processes, the counterpart of ``worker_handle.Worker``."""

import fcntl
import os
import pickle
import signal
import sys
import traceback
from collections.abc import Sequence
from multiprocessing import connection, parent_process
from threading import Thread

from evoros.base.errors import EvorosError, PilotLost
from evoros.base.lazy import collect_rarely
from evoros.executor import protocol

_KEPT = protocol.Kept()


def prepare(folders: Sequence[str] = ()) -> int:
    """Initialize a new worker process, which ends with the main process; return its process id.

    The process leads a new process group. ``folders`` with user modules are added to ``sys.path``.
    """
    end_with_main_process()
    collect_rarely()
    # The default action works without the interpreter, even in C code that never returns.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # Only the main process handles Ctrl-C. A handler, unlike SIG_IGN or a blocked signal, is not
    # inherited by the programs that calls start, some of which must be ended by SIGINT.
    signal.signal(signal.SIGINT, lambda *_: None)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    sys.path[:0] = folders
    return os.getpid()


def run_call(payload: bytes, contents: Sequence[protocol.Shared] = ()) -> protocol.Answer:
    """Unpickle and run a call; cache ``contents`` for it and later calls."""
    _KEPT.add(contents)
    kind = protocol.RETURNED
    try:
        function, args = protocol.unpack_call(payload, _KEPT)
        value = function(*args)
    except protocol.MissingError:
        return protocol.Answer(protocol.MISSING)
    except BaseException as error:
        # Tracebacks cannot be pickled; a note is shown with the main process's traceback.
        error.add_note(f"In the worker process:\n{traceback.format_exc()}")
        kind = protocol.PILOT_LOST if isinstance(error, PilotLost) else protocol.RAISED
        value = error
    try:
        content = pickle.dumps(value)
        if kind != protocol.RETURNED:
            pickle.loads(content)  # fails if __init__ has more parameters than the exception's args
        return protocol.Answer(kind, content)
    except Exception as problem:
        return protocol.Answer(protocol.RAISED, pickle.dumps(_unpicklable(value, problem)))


def _unpicklable(value: object, problem: Exception) -> EvorosError:
    error = EvorosError(
        f"{type(value).__name__}: {value}; this object cannot be sent back from the worker process "
        f"({problem}); return or raise an object that can be pickled, or use executor=serial"
    )
    for note in getattr(value, "__notes__", ()):
        error.add_note(note)
    return error


def end_with_main_process() -> None:
    """Lead a process group that is killed when the parent process ends."""
    os.setpgid(0, 0)
    main = parent_process()
    assert main is not None, "not a worker process"
    end_with(main.sentinel)


def end_with(sentinel: int) -> None:
    """Kill this process's group when the other end of an unused pipe is closed."""
    if sys.platform == "linux":
        # The kernel kills the group even during endless loops in C code.
        fcntl.fcntl(sentinel, fcntl.F_SETOWN, -os.getpid())
        fcntl.fcntl(sentinel, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(sentinel, fcntl.F_GETFL)
        fcntl.fcntl(sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)

    # Other systems need a thread; so does Linux if the main process has already ended.
    def wait() -> None:
        connection.wait([sentinel])
        os.killpg(0, signal.SIGKILL)

    Thread(target=wait, daemon=True).start()

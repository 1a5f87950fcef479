"""An external process that is started for a mission and ends with it."""

import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from evoros.base.errors import LaunchError, PilotLost, single_line
from evoros.executor.protocol import ONE_THREAD

KEEPER = Path(__file__).with_name("keeper.py")
LOG_BYTES, WORDS = 65_536, 400  # maximum output kept [bytes] and quoted in messages [characters]
PERSONAL = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME")
"""Environment variables that name folders outside the mission's home folder."""
END_LIMIT_S = 10.0


@dataclass
class OutsideProcess:
    """An external process; for use by one thread."""

    name: str
    sockets: Mapping[str, socket.socket]  # created in the command's network
    ports: Mapping[str, int]
    _control: socket.socket
    _log: IO[bytes]
    _ended: int | None = field(default=None)  # status from waitpid; None while running

    def fileno(self) -> int:
        """Return a descriptor that is readable after the process has exited."""
        return self._control.fileno()

    def running(self, wait_s: float = 0.0) -> bool:
        """Return True if the process is still running after ``wait_s`` [s]."""
        if self._ended is None and select.select([self._control], [], [], wait_s)[0]:
            news, _ = _receive(self._control)
            self._ended = int(news.get("ended", signal.SIGKILL))
        return self._ended is None

    def lost(self, what: str, time: float | None = None) -> PilotLost:
        """Return the error for a process that exited or hangs, with its status and last output.

        If the process still runs, the error quotes ``what``, for example ``did not answer within 10
        s``. ``time`` [s] is the mission's time; None before the start.
        """
        if not self.running(wait_s=0.2):
            what = f"ended {_describe(self._ended or 0)}"
        when = "before the mission started" if time is None else f"at {time:g} simulated s"
        log = self.read_log()
        words = single_line(log)[-WORDS:]
        said = f"its last output: {words}" if words else "it printed nothing"
        return PilotLost(f"{self.name} {what} {when}; {said}", log)

    def read_log(self) -> str:
        """Return the end of the process's output."""
        size = os.fstat(self._log.fileno()).st_size
        start = max(0, size - LOG_BYTES)
        return os.pread(self._log.fileno(), LOG_BYTES, start).decode(errors="replace")


@contextmanager
def start_process(
    command: Sequence[str],
    *,
    isolate: bool = True,
    environment: Mapping[str, str] | None = None,
    pass_fds: Sequence[int] = (),
    sockets: Mapping[str, str] | None = None,
    files: Mapping[str, str] | None = None,
) -> Iterator[OutsideProcess]:
    """Start a command in an empty home folder; kill it when the context exits.

    In isolation, the command has a new network, process tree, mounts and shared memory
    (namespaces). ``sockets`` maps names to ``udp``, ``tcp`` (listening) or ``port`` (a free port);
    the sockets exist in the command's network before the start, and ``{name}`` in the command is
    replaced with the port. ``files`` maps names of files in the folder to contents. The command
    inherits the descriptors ``pass_fds``. Its processes and files are removed even if this process
    is killed.
    """
    if sys.platform != "linux":
        raise LaunchError(
            f"a controller in a separate process requires Linux, not {sys.platform}; use a "
            "controller "
            "with layers, such as rover, or a Linux machine or container"
        )
    order: dict[str, Any] = {"command": list(command), "isolate": isolate, "pass": list(pass_fds)}
    order |= {"sockets": dict(sockets or {}), "files": dict(files or {})}
    ours, theirs = socket.socketpair()
    with ExitStack() as stack:
        log = stack.enter_context(TemporaryFile(buffering=0))
        with theirs:
            keeper = _start_keeper(theirs, pass_fds, environment or {}, log)
        folders: list[str] = []  # temporary folders of a command without isolation
        stack.callback(_clean_up, keeper, folders)
        stack.enter_context(ours)  # the keeper kills everything when the socket closes
        with suppress(BrokenPipeError, ConnectionResetError):  # the keeper was killed
            ours.sendall(json.dumps(order).encode() + b"\n")
        news, descriptors = _receive(ours, len(order["sockets"]))
        made = [stack.enter_context(socket.socket(fileno=file)) for file in descriptors]
        name = Path(command[0]).name
        if not news and keeper.wait(END_LIMIT_S) == -signal.SIGKILL:
            raise PilotLost(f"{name} was not started, because its parent process was killed")
        if "started" not in news:
            raise _explain(command[0], isolate, news)
        folders += filter(None, [news["folder"]])
        kept = dict(zip(news["started"], made, strict=True))
        yield OutsideProcess(name, kept, news["ports"], ours, log)


def _start_keeper(
    control: socket.socket, pass_fds: Sequence[int], environment: Mapping[str, str], log: IO[bytes]
) -> "subprocess.Popen[bytes]":
    inherited = {name: value for name, value in os.environ.items() if name not in PERSONAL}
    return subprocess.Popen(
        [sys.executable, "-E", "-s", "-S", str(KEEPER), str(control.fileno())],
        env={**inherited, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONHASHSEED": "0", **environment},
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        pass_fds=(control.fileno(), *pass_fds),
        start_new_session=True,
    )


def _clean_up(keeper: "subprocess.Popen[bytes]", folders: Sequence[str]) -> None:
    """Wait until the keeper has killed all processes; kill them here if the keeper was killed."""
    if keeper.poll() is None:  # otherwise its process id may be reused
        _await_end(keeper)
    if keeper.wait() != 0:
        for folder in folders:
            while residents := list(_list_residents(folder)):  # processes may have started others
                for process in residents:
                    with suppress(ProcessLookupError):
                        os.kill(process, signal.SIGKILL)
            shutil.rmtree(folder, ignore_errors=True)


def _await_end(keeper: "subprocess.Popen[bytes]") -> None:
    """Wait for the keeper to exit; Popen.wait could sleep up to twice as long."""
    ended = select.poll()
    descriptor = os.pidfd_open(keeper.pid)
    ended.register(descriptor, select.POLLIN)
    try:
        if not ended.poll(1000.0 * END_LIMIT_S):  # the keeper is stopped
            keeper.kill()  # the kernel then kills the namespace or the command
    finally:
        os.close(descriptor)


def _list_residents(home: str) -> Iterator[int]:
    for path in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):  # the process has exited, or belongs to another user
            if f"HOME={home}".encode() in path.read_bytes().split(b"\0"):
                yield int(path.parent.name)


def _receive(control: socket.socket, sockets: int = 0) -> tuple[dict[str, Any], list[int]]:
    """Receive a message line and up to ``sockets`` descriptors; empty after the keeper's exit."""
    data, descriptors = b"", []
    while not data.endswith(b"\n"):
        try:
            ready = control.recv(4096, socket.MSG_PEEK)
            length = len(ready.split(b"\n", 1)[0]) + 1
            more, files, _, _ = socket.recv_fds(control, length, max(1, sockets))
        except ConnectionResetError:
            break
        if not more:
            break
        data += more
        descriptors += files
    return (json.loads(data) if data.endswith(b"\n") else {}), descriptors


def _explain(program: str, isolated: bool, news: Mapping[str, Any]) -> LaunchError:
    where, why = str(news.get("file", "keeper")), str(news.get("error", "it was killed"))
    if news.get("command"):
        return LaunchError(
            f"{program}: cannot be executed ({why}); correct the path, the permissions or the "
            "script's #! line"
        )
    if isolated:
        return LaunchError(
            f"isolate must be false on a system that does not allow namespaces ({where}: "
            f"{why}); set controller.isolate=false, or allow user namespaces"
        )
    return LaunchError(
        f"{program}: cannot start, because no folder or process could be created ({where}: {why}); "
        "free up disk space, memory or processes, whichever ran out"
    )


def _describe(status: int) -> str:
    if os.WIFSIGNALED(status):
        code = os.WTERMSIG(status)
        return f"by signal {code} ({signal.strsignal(code)})"
    return f"with exit status {os.WEXITSTATUS(status)}"

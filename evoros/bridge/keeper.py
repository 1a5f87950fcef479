"""Starts one command for a mission, and ends it with all that it started. A script.

``process.py`` runs it without ``site``, which spares it half of its start. The
argument is the descriptor of a socket. Through it come one line of JSON, the order, and then the
sockets of the mission and the news of the command go back, a line of JSON each. When the other end
of the socket closes, whatever closed it, the command and its descendants are killed.

Isolated, the command gets a new network, processes, mounts and shared memory. The first process
there is a child of this one, because it has to collect the orphans among the command's descendants.
The kernel kills all of them with it. Otherwise this process adopts the orphans.

Only the standard library is imported, because the namespaces have to exist before anything else
does, and because a thread would keep a process out of a new user namespace.
"""

import array
import json
import os
import select
import signal
import socket
import struct
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evoros.bridge.namespaces import call, isolate, make_sockets, mount
else:  # a script finds what lies beside it
    from namespaces import call, isolate, make_sockets, mount

SET_DEATH_SIGNAL, SET_SUBREAPER = 1, 36  # linux/prctl.h
SHARED_MEMORY = "/dev/shm"
HOME = f"{SHARED_MEMORY}/mission"


class RefusedCommand(OSError):
    """The system does not execute the command."""


def main() -> None:
    """Serve one order, to the end of the command or of the socket."""
    control = socket.socket(fileno=int(sys.argv[1]))
    control.set_inheritable(False)  # the command would hold it open after the end of this process
    with control.makefile("rb") as stream:
        order = json.loads(stream.readline())
    try:
        if order["isolate"]:
            isolate()
        else:
            call("prctl", SET_SUBREAPER, 1, 0, 0, 0)
        sockets, ports = make_sockets(order["sockets"])
        child, status, folder = start(order, ports)
    except OSError as error:
        refused = isinstance(error, RefusedCommand)
        tell(control, error=error.strerror, file=error.filename, command=refused)
        return
    tell(control, list(sockets.values()), started=list(sockets), ports=ports, folder=folder)
    for item in sockets.values():
        item.close()
    for descriptor in order["pass"]:
        os.close(descriptor)  # so that the other end notices when the command closes its own
    try:
        wait_for_end(control, child)
    finally:
        code = read_status(status, end(child))
        if folder is not None:
            end_orphans()
            remove(folder)
    tell(control, ended=code)


def start(order: dict[str, Any], ports: dict[str, int]) -> tuple[int, int, str | None]:
    """Start the command; return the child to watch, a pipe with its status, a folder to remove.

    Raises:
        OSError: the command cannot be executed, or its surroundings cannot be made.
    """
    failure, failing = os.pipe()
    status, reporting = os.pipe()
    folder = None if order["isolate"] else make_folder()
    child = os.fork()
    if child == 0:
        try:
            os.close(failure)
            die_with_keeper(failing)
            if folder is None:
                mount(b"proc", b"/proc", b"proc")
                mount(b"shm", SHARED_MEMORY.encode(), b"tmpfs")
                os.mkdir(HOME)
            prepare_folder(folder or HOME, order["files"])
            if folder is None:
                lead(order, ports, failing, reporting)
            execute(order["command"], ports, folder or HOME)
        except OSError as error:
            content = {"errno": error.errno, "text": error.strerror, "file": error.filename}
            content["command"] = isinstance(error, RefusedCommand)
            os.write(failing, json.dumps(content).encode())
        finally:
            os._exit(1)
    os.close(failing)
    os.close(reporting)
    with os.fdopen(failure, "rb") as stream:
        problem = stream.read()  # empty as soon as the command is executed
    if problem:
        os.waitpid(child, 0)
        if folder is not None:
            remove(folder)
        content = json.loads(problem)
        kind = RefusedCommand if content["command"] else OSError
        raise kind(content["errno"], content["text"], content["file"])
    return child, status, folder


def make_folder() -> str:
    """Make an empty folder."""
    import tempfile  # here, because its import takes as long as the start of Python

    return tempfile.mkdtemp(prefix="evoros-")


def die_with_keeper(failing: int) -> None:
    """Let the kernel kill this process when its parent ends, which holds the pipe's other end."""
    call("prctl", SET_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    broken = select.poll()
    broken.register(failing, 0)  # poll always reports an error, here that nobody reads the pipe
    if broken.poll(0):
        os._exit(1)


def prepare_folder(folder: str, files: dict[str, str]) -> None:
    """Enter the command's folder and write the files that it shall find there."""
    os.chdir(folder)
    for name, text in files.items():
        with open(name, "w", encoding="utf-8") as file:
            file.write(text)


def lead(order: dict[str, Any], ports: dict[str, int], failing: int, reporting: int) -> None:
    """Start the command as the first process of its namespace, wait for it, and exit.

    The exit ends whatever else runs in the namespace.
    """
    command = os.fork()
    if command == 0:
        execute(order["command"], ports, HOME)
    os.close(failing)
    for descriptor in order["pass"]:
        os.close(descriptor)
    while True:
        ended, code = os.waitpid(-1, 0)
        if ended == command:
            os.write(reporting, struct.pack("i", code))
            os._exit(0)


def execute(command: list[str], ports: dict[str, int], folder: str) -> None:
    """Become the command.

    Raises:
        RefusedCommand: it cannot be executed.
    """
    os.environ.update(HOME=folder, TMPDIR=folder, PWD=folder)
    for changed in (signal.SIGINT, signal.SIGPIPE, signal.SIGXFSZ):  # by Python
        signal.signal(changed, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for name, port in ports.items():
        command = [part.replace(f"{{{name}}}", str(port)) for part in command]
    try:
        os.execvp(command[0], command)
    except OSError as error:
        raise RefusedCommand(error.errno, error.strerror, error.filename) from None


def wait_for_end(control: socket.socket, child: int) -> None:
    """Wait until the child ends, or until the other end of the socket closes."""
    waiting = select.poll()
    waiting.register(control, select.POLLIN)
    waiting.register(os.pidfd_open(child), select.POLLIN)
    waiting.poll()


def end(child: int) -> int:
    """Kill the child, and with it its namespace; return the child's status."""
    os.kill(child, signal.SIGKILL)  # an ended child remains until it is waited for
    return os.waitpid(child, 0)[1]


def end_orphans() -> None:
    """Kill the processes that the command has left, which are now children of this one."""
    while True:
        for orphan in children():
            os.kill(orphan, signal.SIGKILL)
        try:
            os.waitpid(-1, 0)  # the death of one may bring others
        except ChildProcessError:
            return


def remove(folder: str) -> None:
    """Remove a folder, even if the command has taken its own rights away."""
    import shutil  # here for the same reason as tempfile

    for place, folders, _ in os.walk(folder):
        for path in (os.path.join(place, name) for name in folders):
            if not os.path.islink(path):
                os.chmod(path, 0o700)
    shutil.rmtree(folder, ignore_errors=True)


def children() -> list[int]:
    """List the processes whose parent is this one."""
    pids = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat", "rb") as file:
                parent = int(file.read().rpartition(b")")[2].split()[1])
        except OSError:  # it has ended meanwhile
            continue
        if parent == os.getpid():
            pids.append(int(name))
    return pids


def read_status(pipe: int, code: int) -> int:
    """Return the command's status, which its namespace reported, or else the child's."""
    os.set_blocking(pipe, False)
    try:
        reported = os.read(pipe, 4)
    except BlockingIOError:
        reported = b""
    return int(struct.unpack("i", reported)[0]) if reported else code


def tell(control: socket.socket, files: list[socket.socket] | None = None, **news: object) -> None:
    """Send a line of news, with sockets; nobody may be there any more."""
    ancillary = []
    if files:
        descriptors = array.array("i", [item.fileno() for item in files])
        ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, descriptors)]
    with suppress(OSError):
        control.sendmsg([json.dumps(news).encode() + b"\n"], ancillary)


if __name__ == "__main__":
    main()

"""A script that runs one command for a mission and kills all its descendants at the end.

``process.py`` runs the script without ``site``; its argument is the file descriptor of a socket.
The script reads the order, one line of JSON, and sends the mission's sockets and messages about the
command, one line of JSON each. When the other end closes the socket, the command and its
descendants are killed.

In isolation (a new network, process tree, mounts and shared memory), the kernel kills them when the
first process of the namespaces ends. Otherwise, this process adopts and kills the orphans.
bubblewrap cannot replace the script, because it has no multicast, which ROS 2 needs, and the
sockets must exist before the command starts.

Only the standard library is imported, because a process with threads cannot enter a new user
namespace.
"""

import array
import ctypes
import errno
import fcntl
import json
import os
import select
import signal
import socket
import struct
import sys
from contextlib import suppress
from typing import Any

# Constants in linux/sched.h, linux/mount.h, linux/sockios.h and linux/if.h.
MOUNTS, IPC, PIDS, NETWORK = 0x20000, 0x8000000, 0x20000000, 0x40000000
NAMESPACES, NEW_USER = MOUNTS | IPC | PIDS | NETWORK, 0x10000000
RECURSIVE, PRIVATE = 0x4000, 0x40000
GET_FLAGS, SET_FLAGS, UP_AND_MULTICAST = 0x8913, 0x8914, 0x1 | 0x1000

LIBC = ctypes.CDLL(None, use_errno=True)
SET_DEATH_SIGNAL, SET_SUBREAPER = 1, 36  # linux/prctl.h
SHARED_MEMORY = "/dev/shm"
HOME = f"{SHARED_MEMORY}/mission"


class RefusedCommand(OSError):
    """The system cannot execute the command."""


def main() -> None:
    """Execute one order until the command exits or the socket closes."""
    control = socket.socket(fileno=int(sys.argv[1]))
    # otherwise, the command would keep the socket open after this process
    control.set_inheritable(False)
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
        os.close(descriptor)  # the other end is then notified when the command closes its copy
    try:
        wait_for_end(control, child)
    finally:
        code = read_status(status, end(child))
        if folder is not None:
            end_orphans()
            remove(folder)
    tell(control, ended=code)


def start(order: dict[str, Any], ports: dict[str, int]) -> tuple[int, int, str | None]:
    """Start the command; return the child process, its status pipe, and a folder to remove."""
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
        problem = stream.read()  # empty if the command was executed
    if problem:
        os.waitpid(child, 0)
        if folder is not None:
            remove(folder)
        content = json.loads(problem)
        kind = RefusedCommand if content["command"] else OSError
        raise kind(content["errno"], content["text"], content["file"])
    return child, status, folder


def make_folder() -> str:
    """Create an empty temporary folder."""
    import tempfile  # imported here, because the import takes as long as the start of Python

    return tempfile.mkdtemp(prefix="evoros-")


def die_with_keeper(failing: int) -> None:
    """Let the kernel kill this process when its parent, at the other end of the pipe, exits."""
    call("prctl", SET_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    broken = select.poll()
    broken.register(failing, 0)  # poll always reports errors, such as a pipe without a reader
    if broken.poll(0):
        os._exit(1)


def prepare_folder(folder: str, files: dict[str, str]) -> None:
    """Change to the command's folder and write its files."""
    os.chdir(folder)
    for name, text in files.items():
        with open(name, "w", encoding="utf-8") as file:
            file.write(text)


def lead(order: dict[str, Any], ports: dict[str, int], failing: int, reporting: int) -> None:
    """Start the command as the first process of a namespace, wait for its end, and exit."""
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
    """Replace this process with the command; raise a RefusedCommand on failure."""
    os.environ.update(HOME=folder, TMPDIR=folder, PWD=folder)
    for changed in (signal.SIGINT, signal.SIGPIPE, signal.SIGXFSZ):  # handlers changed by Python
        signal.signal(changed, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for name, port in ports.items():
        command = [part.replace(f"{{{name}}}", str(port)) for part in command]
    try:
        os.execvp(command[0], command)
    except OSError as error:
        raise RefusedCommand(error.errno, error.strerror, error.filename) from None


def wait_for_end(control: socket.socket, child: int) -> None:
    """Wait until the child exits or the other end closes the socket."""
    waiting = select.poll()
    waiting.register(control, select.POLLIN)
    waiting.register(os.pidfd_open(child), select.POLLIN)
    waiting.poll()


def end(child: int) -> int:
    """Kill the child and its namespace; return the child's status."""
    os.kill(child, signal.SIGKILL)  # safe, because an exited child keeps its id until waitpid
    return os.waitpid(child, 0)[1]


def end_orphans() -> None:
    """Kill the processes left by the command, which are now children of this process."""
    while True:
        for orphan in children():
            os.kill(orphan, signal.SIGKILL)
        try:
            os.waitpid(-1, 0)  # the orphans may have children
        except ChildProcessError:
            return


def remove(folder: str) -> None:
    """Remove a folder, even if the command has made it read-only."""
    import shutil  # delayed like tempfile

    for place, folders, _ in os.walk(folder):
        for path in (os.path.join(place, name) for name in folders):
            if not os.path.islink(path):
                os.chmod(path, 0o700)
    shutil.rmtree(folder, ignore_errors=True)


def children() -> list[int]:
    """List the child processes of this process."""
    pids = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat", "rb") as file:
                parent = int(file.read().rpartition(b")")[2].split()[1])
        except OSError:  # the process has exited
            continue
        if parent == os.getpid():
            pids.append(int(name))
    return pids


def read_status(pipe: int, code: int) -> int:
    """Return the command's status as reported in the pipe, or else the child's status."""
    os.set_blocking(pipe, False)
    try:
        reported = os.read(pipe, 4)
    except BlockingIOError:
        reported = b""
    return int(struct.unpack("i", reported)[0]) if reported else code


def tell(control: socket.socket, files: list[socket.socket] | None = None, **news: object) -> None:
    """Send a message line with sockets; do nothing if the other end is closed."""
    ancillary = []
    if files:
        descriptors = array.array("i", [item.fileno() for item in files])
        ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, descriptors)]
    with suppress(OSError):
        control.sendmsg([json.dumps(news).encode() + b"\n"], ancillary)


def call(name: str, *arguments: object) -> None:
    """Call a C library function; raise an OSError with its name on failure."""
    if getattr(LIBC, name)(*arguments) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code), name)


def isolate() -> None:
    """Enter new namespaces with a loopback interface; raise an OSError on failure."""
    unshare()
    try:
        raise_loopback()
    except OSError as error:  # occurs in user namespaces without permissions
        raise OSError(error.errno, error.strerror, "unshare: loopback") from None


def unshare() -> None:
    """Enter new namespaces, if necessary in a new user namespace; raise an OSError on failure."""
    user, group = os.geteuid(), os.getegid()
    try:
        call("unshare", NAMESPACES)
    except OSError as error:
        if error.errno != errno.EPERM:
            raise
        call("unshare", NAMESPACES | NEW_USER)
        maps = {"setgroups": "deny", "uid_map": f"{user} {user} 1", "gid_map": f"{group} {group} 1"}
        for name, text in maps.items():
            with open(f"/proc/self/{name}", "w", encoding="utf-8") as file:
                file.write(text)
    mount(b"none", b"/", None, RECURSIVE | PRIVATE)


def mount(source: bytes, target: bytes, kind: bytes | None, flags: int = 0) -> None:
    """Mount a file system in the namespace; raise an OSError with the target on failure."""
    try:
        call("mount", source, target, kind, flags, None)
    except OSError as error:
        raise OSError(error.errno, error.strerror, f"mount {target.decode()}") from None


def raise_loopback() -> None:
    """Enable the loopback interface and multicast, which ROS 2 needs to discover nodes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sh", b"lo", 0)
        flags = struct.unpack("16sh", fcntl.ioctl(any_socket, GET_FLAGS, request))[1]
        fcntl.ioctl(any_socket, SET_FLAGS, struct.pack("16sh", b"lo", flags | UP_AND_MULTICAST))


def make_sockets(kinds: dict[str, str]) -> tuple[dict[str, socket.socket], dict[str, int]]:
    """Create sockets in the command's network; return the sockets to keep, and all ports."""
    kept, ports, free = {}, {}, []
    for name, kind in kinds.items():
        stream = kind == "tcp"
        item = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
        item.bind(("127.0.0.1", 0))
        ports[name] = item.getsockname()[1]
        if stream:
            item.listen()
        if kind == "port":
            free.append(item)  # closed after all are bound, so that all ports differ
        else:
            kept[name] = item
    for item in free:
        item.close()
    return kept, ports


if __name__ == "__main__":
    main()

"""The namespaces and the sockets of a mission. Standard library only, for the keeper; Linux."""

import ctypes
import errno
import fcntl
import os
import socket
import struct

# linux/sched.h, linux/mount.h, linux/sockios.h, linux/if.h
MOUNTS, IPC, PIDS, NETWORK = 0x20000, 0x8000000, 0x20000000, 0x40000000
NAMESPACES, NEW_USER = MOUNTS | IPC | PIDS | NETWORK, 0x10000000
RECURSIVE, PRIVATE = 0x4000, 0x40000
GET_FLAGS, SET_FLAGS, UP_AND_MULTICAST = 0x8913, 0x8914, 0x1 | 0x1000

LIBC = ctypes.CDLL(None, use_errno=True)


def call(name: str, *arguments: object) -> None:
    """Call a function of the C library.

    Raises:
        OSError: it failed; its file name is the function's.
    """
    if getattr(LIBC, name)(*arguments) != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code), name)


def isolate() -> None:
    """Enter new namespaces whose loopback interface is up.

    Raises:
        OSError: the system does not allow it; its file name is what failed.
    """
    unshare()
    try:
        raise_loopback()
    except OSError as error:  # of a user namespace that has no rights
        raise OSError(error.errno, error.strerror, "unshare: loopback") from None


def unshare() -> None:
    """Enter new namespaces, of a new user with the same number if there is no other way.

    Raises:
        OSError: the system allows neither.
    """
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
    """Mount a file system in the namespace.

    Raises:
        OSError: it failed; its file name is the place.
    """
    try:
        call("mount", source, target, kind, flags, None)
    except OSError as error:
        raise OSError(error.errno, error.strerror, f"mount {target.decode()}") from None


def raise_loopback() -> None:
    """Bring up the loopback interface, with multicast, by which ROS 2 discovers nodes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sh", b"lo", 0)
        flags = struct.unpack("16sh", fcntl.ioctl(any_socket, GET_FLAGS, request))[1]
        fcntl.ioctl(any_socket, SET_FLAGS, struct.pack("16sh", b"lo", flags | UP_AND_MULTICAST))


def make_sockets(kinds: dict[str, str]) -> tuple[dict[str, socket.socket], dict[str, int]]:
    """Make sockets in the command's network; return those to keep, and the ports of all."""
    kept, ports, free = {}, {}, []
    for name, kind in kinds.items():
        stream = kind == "tcp"
        item = socket.socket(socket.AF_INET, socket.SOCK_STREAM if stream else socket.SOCK_DGRAM)
        item.bind(("127.0.0.1", 0))
        ports[name] = item.getsockname()[1]
        if stream:
            item.listen()
        if kind == "port":
            free.append(item)  # closed after all are bound, so that all differ
        else:
            kept[name] = item
    for item in free:
        item.close()
    return kept, ports

"""Reads untrusted zip files safely, and writes zip files with a SHA-256 digest as comment."""

import hashlib
import stat
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, LargeZipFile, ZipFile, ZipInfo

from evoros.base.errors import InputError, single_line
from evoros.files.disk import LARGE, open_regular

MOST_MEMBERS = 200_000
LARGEST = 16 * 2**30  # maximum total size [bytes] of all unpacked members
RATIO = 100  # maximum compression ratio of a member
ANY_RATIO = 2**20  # size [bytes] of unpacked members up to which the ratio is unlimited
MARK = b"evoros sha256:"
_GET_AGAIN = "download or copy the file again"
_DAMAGES = (BadZipFile, LargeZipFile, EOFError, NotImplementedError, ValueError, zlib.error)


@contextmanager
def open_zip(path: Path) -> Iterator[tuple[ZipFile, Mapping[str, ZipInfo]]]:
    """Open a zip file, check that its members can be unpacked safely, and yield them by name."""
    with _explain(path), open_regular(path) as file, ZipFile(file) as archive:
        members = _check_members(path, archive.infolist())
        if not archive.comment.startswith(MARK) or archive.comment != _mark(
            file, len(archive.comment)
        ):
            raise InputError(f"{path}: {_find_damage(archive)} has changed; {_GET_AGAIN}")
        yield archive, members


def read_member(path: Path, archive: ZipFile, member: ZipInfo) -> bytes:
    """Read all of a member."""
    with _explain(path):
        return archive.read(member)


def add_member(archive: ZipFile, name: str, content: bytes) -> None:
    """Add a file with a fixed date and mode, so that equal contents give equal bytes."""
    member = ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    member.external_attr = (stat.S_IFREG | 0o644) << 16
    member.create_system = 3  # Unix, on all operating systems
    packed = zlib.compress(content, 6)
    bounded = len(content) <= min(ANY_RATIO, RATIO) or len(content) < RATIO // 2 * len(packed)
    member.compress_type = ZIP_DEFLATED if bounded else ZIP_STORED
    archive.writestr(member, content, compresslevel=6)


def require_fitting(path: Path, name: str, size: int, total: int) -> None:
    """Require that an added file and the total so far are within the limits for reading."""
    if size > LARGE or total > LARGEST:
        raise InputError(
            f"{path}: {name!r} exceeds the limit of {LARGE >> 20} MiB per file or of "
            f"{LARGEST >> 30} GiB in total; move that file elsewhere, or archive fewer folders"
        )


def add_folder(archive: ZipFile, name: str) -> None:
    """Add a folder entry, which readers of RO-Crates need."""
    member = ZipInfo(f"{name}/", (1980, 1, 1, 0, 0, 0))
    member.external_attr = (stat.S_IFDIR | 0o755) << 16 | 0x10
    member.create_system = 3
    archive.writestr(member, b"")


def seal_zip(file: BinaryIO) -> None:
    """Write the digest of a closed zip file to its comment."""
    with ZipFile(file, "a") as archive:
        archive.comment = MARK + b"0" * 64
    comment = _mark(file, len(MARK) + 64)
    file.seek(-64, 2)
    file.write(comment[-64:])


def _mark(file: BinaryIO, length: int) -> bytes:
    """Return the correct comment, with ``length`` bytes, for a zip file."""
    left = file.seek(0, 2) - length
    file.seek(0)
    digest = hashlib.sha256()
    while left > 0:
        content = file.read(min(left, 2**20))
        digest.update(content)
        left -= len(content) or left
    return MARK + digest.hexdigest().encode()


def _check_members(path: Path, members: list[ZipInfo]) -> dict[str, ZipInfo]:
    if len(members) > MOST_MEMBERS:
        raise _refuse(path, f"contain at most {MOST_MEMBERS} files", f"not {len(members)}")
    total, by_name = 0, dict[str, ZipInfo]()
    for member in members:
        name = member.orig_filename.removesuffix("/")
        if name in by_name:
            raise _refuse(path, "contain each file only once", f"but has {name!r} twice")
        _check_member(path, name, member)
        by_name[name] = member
        total += member.file_size
    folders = {name for name, member in by_name.items() if member.is_dir()}
    if total > LARGEST:
        raise _refuse(path, f"unpack to at most {LARGEST >> 30} GiB", f"not {total >> 30} GiB")
    for name in by_name:
        above = {str(place) for place in Path(name).parents} & (by_name.keys() - folders)
        if above:
            raise _refuse(path, "not name a file like a folder", f"but {above.pop()!r} is both")
    return {name: member for name, member in by_name.items() if name not in folders}


def _check_member(path: Path, name: str, member: ZipInfo) -> None:
    parts = name.split("/")
    strange = "\\" in name or ":" in name or not name.isprintable() or "\0" in name
    if strange or any(part in ("", ".", "..") for part in parts) or max(map(len, parts)) > 255:
        rule = r"contain only normalized relative paths without \ and :, with parts of "
        raise _refuse(path, f"{rule}1 to 255 printable characters", f"not {name!r}")
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFDIR if member.is_dir() else stat.S_IFREG):
        raise _refuse(path, "contain only files and folders", f"but {name!r} is a link or a device")
    if member.is_dir() and member.file_size:
        raise _refuse(path, "contain no folder with data", f"but the folder {name!r} has data")
    if member.flag_bits & 1:
        raise _refuse(path, "contain no encrypted file", f"but {name!r} is encrypted")
    if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise _refuse(path, "contain only stored or deflated files", f"but {name!r} is neither")
    if member.file_size > LARGE:
        raise _refuse(path, f"contain no file above {LARGE >> 20} MiB", f"but {name!r} is larger")
    if member.file_size > max(ANY_RATIO, RATIO * member.compress_size):
        ratio = member.file_size // max(member.compress_size, 1)
        raise _refuse(path, f"have compression ratios up to {RATIO}", f"but {name!r} has {ratio}")


def _find_damage(archive: ZipFile) -> str:
    """Describe the first damaged member, or the structure, to complete "... has changed"."""
    for member in archive.infolist():
        try:
            archive.read(member)
        except _DAMAGES:
            return repr(member.filename)
    return "the structure of the zip file"


@contextmanager
def _explain(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {_GET_AGAIN}") from error
    except _DAMAGES as error:
        problem = f"must be an undamaged zip file ({single_line(error)})"
        raise InputError(f"{path}: {problem}; {_GET_AGAIN}") from error


def _refuse(path: Path, rule: str, value: str, fix: str = "do not unpack it") -> InputError:
    return InputError(f"{path}: must {rule}, {value}; {fix}")

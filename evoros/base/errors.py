"""Errors with messages for users, and the commands that fix them."""

import errno
import os
import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

GIVE_RIGHTS = "give this user read and write permission"
PATH_REMEDIES = {
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), GIVE_RIGHTS),
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ELOOP: "remove one of the symbolic links that form a loop",
}
"""Fixes for errors of path operations, keyed by error number."""
_LOOP = "Symlink loop from "
_NAMED = 6  # maximum number of names that a message lists


class EvorosError(Exception):
    """The base class of all errors with a message for the user."""


class InputError(EvorosError):
    """A configuration value or file is unusable. Exit status 2; the message has one line."""


class PartFault(InputError):
    """A part returned an invalid value, which the author of the part must correct."""


class SimulationError(EvorosError):
    """The simulation failed, for example with a non-finite state; a retry would fail too."""


class WorkerLost(EvorosError):
    """A call crashed its worker process or exceeded its time limit, in all attempts."""


class PilotLost(WorkerLost):
    """An external controller or engine exited or did not answer; the mission can be repeated."""

    def __init__(self, message: str, log: str = "") -> None:
        super().__init__(message, log)
        self.log = log  # last output of the process

    def __str__(self) -> str:
        return str(self.args[0])


class LaunchError(InputError):
    """An external controller or engine cannot be started for any design."""


class RunStopped(EvorosError):
    """The run stopped early and can be resumed. Exit status 1."""


def single_line(message: object) -> str:
    """Return an error or another object as a string on one line."""
    return escape(" ".join(str(message).split()))


def escape(path: str) -> str:
    """Escape the bytes of a path that are not valid UTF-8."""
    return path.encode(errors="backslashreplace").decode()


def unescape(path: str) -> str:
    """Reverse ``escape``."""
    return _ESCAPED.sub(lambda byte: chr(int(byte[1], 16)), path)


@contextmanager
def require_extra(extra: str, need: str, failure: type[InputError] = InputError) -> Iterator[None]:
    """Raise ``failure``, naming ``need``, if the context imports a missing package."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise failure(
            f"{need}: needs the package {package}, which is not installed; type: pip install "
            f"'evoros[{extra}]'"
        ) from None


def explain_path(error: BaseException) -> str:
    """Explain an error of a path operation on one line; return "" for other errors."""
    if isinstance(error, RuntimeError) and str(error).startswith(_LOOP):  # before Python 3.13
        return f"{str(error).removeprefix(_LOOP)}: cannot be used; {PATH_REMEDIES[errno.ELOOP]}"
    if not isinstance(error, OSError) or error.errno not in PATH_REMEDIES or not error.filename:
        return ""
    return f"{error.filename}: cannot be used ({error.strerror}); {PATH_REMEDIES[error.errno]}"


_PLAIN = re.compile(
    r"(?!(null|true|false|inf|nan)$)([a-z_/]|\.\.?/)[\w./-]*", re.ASCII | re.IGNORECASE
)
_ESCAPED = re.compile(r"\\u(dc[89a-f][0-9a-f])")
_BEFORE_QUOTE = re.compile(r'(\\*)("|$)')
_LOST = re.compile(r"[^\S ]|  |[\x00-\x1f\x7f-\x9f\ud800-\udfff]")
"""Matches characters that a one-line message or a terminal would not show as they are."""

MAX_DIGITS = 6  # maximum number of decimals


def count_digits(size: float) -> int:
    """Return the number of decimals, at most ``MAX_DIGITS``, for two digits of ``size``."""
    return next((digits for digits in range(MAX_DIGITS) if size * 10**digits >= 9.5), MAX_DIGITS)


def write_count(number: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless the count is 1."""
    return f"{number:,} {noun}" + "s" * (number != 1)


def list_names(names: Sequence[str]) -> str:
    """Return names for a message, separated by commas; after ``_NAMED`` names, their number."""
    more = f" and {len(names) - _NAMED:,} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def shell_line(*words: str) -> str:
    """Return a shell command line of these words."""
    return " ".join(map(_quote_word, words))


def _quote_word(word: str) -> str:
    if _LOST.search(word) is None:
        return shlex.quote(word)
    shown = "".join(
        chr(byte) if 32 < byte < 127 and byte not in b"\\'" else f"\\x{byte:02x}"
        for byte in os.fsencode(word)
    )
    return f"$'{shown}'"


def override(key: str, value: object) -> str:
    """Return ``key=value`` in Hydra's grammar, as a word for ``shell_line``."""
    return f"{key}={write_value(value)}"


def write_value(value: object) -> str:
    """Return a configuration value in Hydra's grammar."""
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) else quote_value(value)
    if isinstance(value, list):
        return f"[{','.join(map(write_value, value))}]"
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    return "{}" if value == {} else repr(value)


def quote_value(text: str) -> str:
    """Quote a string for Hydra, in which a backslash escapes only before a quote."""
    escaped = _BEFORE_QUOTE.sub(lambda end: 2 * end[1] + (end[2] and f"\\{end[2]}"), text)
    return f'"{escaped}"'

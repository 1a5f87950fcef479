"""Parses the arguments of commands, and suggests quotes for paths that were split at a space."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from itertools import takewhile
from typing import NoReturn

from evoros.base.errors import InputError, override, shell_line


class CommandParser(ArgumentParser):
    """A parser whose errors are InputErrors, which commands report in one line."""

    def error(self, message: str) -> NoReturn:
        """Raise an InputError with the parser's message."""
        raise InputError(f"{message}; see {self.prog} --help")

    def parse(self, words: Sequence[str]) -> Namespace:
        """Parse the words of a command; suggest quotes if a path with spaces was split."""
        options, rest = self.parse_known_args(list(words))
        if rest:
            before = words[: words.index(rest[0])][-1:]
            split = before and not any(word.startswith("-") for word in (*before, *rest))
            advice = f"; {_advise_quotes(*before, *rest)}" if split else ""
            self.error(f"{rest[0]}: is an unexpected argument{advice}")
        return options


def require_keys(words: Sequence[str], before: str) -> None:
    """Require that each word is ``key=value`` or the deletion ``~key``.

    ``before`` was typed before the words: a folder, or ``key=``, to which a folder belongs.

    Raises:
        InputError: a word is neither; the message suggests quotes that may be missing.
    """
    for i, word in enumerate(words):
        if not _stands_alone(word):
            before = word
            continue
        rest = takewhile(_stands_alone, words[i:])
        raise InputError(f"{word!r}: must be key=value; {_advise_quotes(before, *rest)}")


def _stands_alone(word: str) -> bool:
    return "=" not in word and not word.startswith("~")


def _advise_quotes(before: str, *rest: str) -> str:
    key, equals, value = before.partition("=")
    if not equals:
        return f"a path with a space needs quotes: {shell_line(' '.join((before, *rest)))}"
    whole = " ".join(filter(None, (value, *rest)))
    advice = "a value with a space needs quotes:" if " " in whole else "type"
    return f"{advice} {shell_line(override(key, whole))}"

"""Arguments of commands, and messages about words that a missing quote has split."""

import shlex
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from itertools import takewhile
from typing import NoReturn

from evoros.base.errors import InputError


class CommandParser(ArgumentParser):
    """A parser that raises errors of evoros, which commands report in one line."""

    def error(self, message: str) -> NoReturn:
        """Refuse the arguments."""
        raise InputError(f"{message}; see {self.prog} --help")

    def parse(self, words: Sequence[str]) -> Namespace:
        """Parse the words of a command; one word too many may be the end of a path."""
        options, rest = self.parse_known_args(list(words))
        if rest:
            before = words[: words.index(rest[0])][-1:]
            split = before and not any(word.startswith("-") for word in (*before, *rest))
            advice = f"; {_advise_quotes(*before, *rest)}" if split else ""
            self.error(f"{rest[0]}: is one argument too many{advice}")
        return options


def require_keys(words: Sequence[str], before: str) -> None:
    """Refuse a word that is neither ``key=value`` nor the deletion ``~key``.

    ``before`` is the folder before the words, or the key with ``=`` to which a folder belongs.

    Raises:
        InputError: there is such a word; the message has the quotes that may be missing.
    """
    for i, word in enumerate(words):
        if not _stands_alone(word):
            before = word
            continue
        rest = takewhile(_stands_alone, words[i:])
        raise InputError(
            f"{word!r}: stands alone, and must be key=value; {_advise_quotes(before, *rest)}"
        )


def _stands_alone(word: str) -> bool:
    return "=" not in word and not word.startswith("~")


def _advise_quotes(before: str, *rest: str) -> str:
    """Advise to type a word and the ones after it as one; Hydra needs quotes of its own."""
    key, equals, value = before.partition("=")
    if not equals:
        return f"a path with a space needs quotes: {shlex.quote(' '.join((before, *rest)))}"
    whole = " ".join(filter(None, (value, *rest)))
    if " " not in whole:
        return f"type {shlex.quote(f'{key}={whole}')}"
    quoted = f'{key}="{whole}"'
    return f"a value with a space needs quotes: {shlex.quote(quoted)}"

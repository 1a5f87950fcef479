"""Refuses to archive what tells about the machine or its user: paths, host, environment."""

import os
import re
import socket
from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from urllib.parse import quote

from evoros.base.errors import InputError

_SHORTEST = 8
"""Shorter values of variables are words that stand anywhere [characters]."""
LOCAL = "localhost"


def is_telling(host: str) -> bool:
    """Whether the name of a machine is no word that stands anywhere."""
    return len(host) >= _SHORTEST and host != LOCAL


class Secrets:
    """Texts that no file of an archive may have, with what each is.

    ``harmless`` has values of variables that archives have anyway, such as a commit.
    """

    def __init__(
        self, paths: Iterable[Path], harmless: Collection[str], environment: Mapping[str, str]
    ) -> None:
        home = Path.home()
        self._texts: dict[str, str] = {}
        for path in paths:
            if len(path.parts) > 2:
                self._texts[str(path)] = "a path of this machine"
        if home != Path("/"):
            self._texts[str(home)] = "the path of your home folder"
        host = socket.gethostname()
        if is_telling(host) and host not in harmless:
            self._texts[host] = "the name of this machine"
        for name, value in environment.items():
            system = os.path.isabs(value) and os.path.exists(value)
            if len(value) >= _SHORTEST and not system and value not in harmless:
                self._texts.setdefault(value, f"the value of the environment variable {name}")
        self._texts |= {quote(text): kind for text, kind in self._texts.items() if "/" in text}

    @cached_property
    def _pattern(self) -> re.Pattern[bytes]:
        texts = sorted(self._texts, key=len, reverse=True)
        return re.compile(b"|".join(map(_match, texts)))

    def require_none(self, name: str, content: bytes) -> None:
        """Require that neither the name nor the content of a file has any of these texts."""
        if not any(os.fsencode(text) in content or text in name for text in self._texts):
            return
        match = self._pattern.search(content) or self._pattern.search(os.fsencode(name))
        if match is None:
            return
        kind = self._texts[os.fsdecode(match[0])]
        line = content.count(b"\n", 0, match.start()) + 1
        fix = "take it out, or unset the variable if it is no secret"
        if "variable" not in kind:
            fix = "write a relative path, or take it out"
        raise InputError(f"{name}: line {line}: must not have {kind} to be archived; {fix}")


def _match(text: str) -> bytes:
    """Return the pattern of a text; a path may not be the end or the begin of another name."""
    pattern = re.escape(os.fsencode(text))
    return rb"(?<![\w.-])" + pattern + rb"(?![\w-])" if os.path.isabs(text) else pattern

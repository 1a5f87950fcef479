"""Text in lines, whose words stay whole."""

import textwrap
from collections.abc import Iterable


def wrap_lines(text: str, room: float, minimum: int = 8) -> list[str]:
    """Return text in one or more lines of ``room`` characters, parted between words alone."""
    words = text.replace("_", " ")
    return textwrap.wrap(
        words, max(minimum, int(room)), break_long_words=False, break_on_hyphens=False
    ) or [""]


def wrap(text: str, room: float, minimum: int = 8) -> str:
    """Return the lines of ``wrap_lines`` as one text."""
    return "\n".join(wrap_lines(text, room, minimum))


def cut_short(text: str, length: int) -> str:
    """Cut a text that is longer."""
    return text if len(text) <= length else text[: length - 3] + "..."


def wrap_all(lines: Iterable[str], room: float, minimum: int = 8) -> str:
    """Wrap each of several lines as ``wrap`` does, and join them."""
    return "\n".join(wrap(line, room, minimum) for line in lines)

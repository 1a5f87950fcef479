"""Worlds as evoros writes them, which run no code and lead to no files but those beside them."""

import re
from pathlib import Path

from evoros.base.errors import InputError
from evoros.formats.lenient_xml import is_xacro
from evoros.formats.strict_xml import parse

_NAME = re.compile(r"[\w-][\w.-]*")


def require_closed(path: Path) -> None:
    """Require that an SDF file has no xacro and no includes, and names files beside it alone.

    Raises:
        InputError: it is otherwise, or no XML.
    """
    content = path.read_bytes()
    problem = (
        "has xacro, which is code" if is_xacro(path, content) else _find_problem(path, content)
    )
    if problem:
        raise InputError(f"{path}: must be a world as evoros writes it, but {problem}; restore it")


def _find_problem(path: Path, content: bytes) -> str:
    for element in parse(content, str(path)).iter():
        text = (element.text or "").strip()
        if element.tag == "include":
            return "includes another file"
        if element.tag in ("uri", "filename") and not _NAME.fullmatch(text):
            return f"names a file elsewhere, {text!r}"
    return ""

"""Worlds as evoros writes them, which run no code and lead to no files but those beside them."""

import re
from pathlib import Path

from evoros.base.errors import InputError
from evoros.formats.lenient_xml import is_xacro
from evoros.formats.strict_xml import parse

_NAME = re.compile(r"[\w-][\w.-]*")


def require_closed(path: Path) -> None:
    """Require that an SDF file has no xacro and no includes, and names files beside it alone."""
    content = path.read_bytes()
    problems = ["has xacro, which is code"] if is_xacro(path, content) else []
    for element in () if problems else parse(content, str(path)).iter():
        text = (element.text or "").strip()
        if element.tag == "include":
            problems.append("includes another file")
        if element.tag in ("uri", "filename") and not _NAME.fullmatch(text):
            problems.append(f"names a file elsewhere, {text!r}")
    if problems:
        rule = "must be a world as evoros writes it"
        raise InputError(f"{path}: {rule}, but {problems[0]}; restore it")

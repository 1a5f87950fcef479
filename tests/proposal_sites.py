"""Collects from the source what messages propose to type.

No mark is needed: in a message, a word with ``=``, a word that begins with ``--``, and a line that
begins with ``evoros`` or another program is what a user types. Values that a message fills in
appear here as ``{expression}``.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from helpers import ROOT

_FILLED = r"\{[^{}]*\}"
_LIST = rf"\[(?:[^\[\]]|\[[^\]]*\]|{_FILLED})*\]"
_VALUE = rf"(?:\"[^\"]*\"|{_LIST}|[a-z]+\([^)]*\)|(?:{_FILLED}|[^\s;,)'\"`])+)"
_KEY = rf"[+~]?(?:[a-z_]\w*|{_FILLED})(?:[.@/](?:\w|{_FILLED})+)*"
OVERRIDE = re.compile(rf"(?<![\w./<\"{{}}%@-])({_KEY})=({_VALUE})")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
COMMAND = re.compile(r"\bevoros ([a-z]+)(?: ([a-z]+))?")
INSTALL = re.compile(r"pip install '?([\w{}-]+(?:\[[^\]]+\])?)")
_EXTRA = re.compile(r"require_extra\(\s*\"([^\"]*)\"")
_TEXTS_OF_HELP = ("help", "usage", "epilog", "description", "metavar")


class Message(NamedTuple):
    """A literal that a user may read."""

    place: str  # file and line
    text: str


def source_files() -> Iterator[Path]:
    """Yield the modules of the package."""
    for folder in ("evoros", "analysis"):
        files = sorted((ROOT / folder).rglob("*.py"))
        yield from (file for file in files if "tests" not in file.parts)


@cache
def list_messages() -> tuple[Message, ...]:
    """Return all messages of the package: literals of one line that are no help and no XML."""
    return tuple(message for file in source_files() for message in _read_module(file))


def _read_module(file: Path) -> Iterator[Message]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    left_out = {id(node) for node in _list_others(tree)}
    for node in ast.walk(tree):
        text = "" if id(node) in left_out else _read(node)
        if " " in text and not ("\n" in text or text.lstrip().startswith("<")):
            line = getattr(node, "lineno", 0)
            yield Message(f"{file.relative_to(ROOT)}:{line}", text)


def _list_others(tree: ast.Module) -> Iterator[ast.AST]:
    for node in ast.walk(tree):
        match node:
            case ast.Module() | ast.ClassDef() | ast.FunctionDef():
                yield from (s.value for s in node.body if isinstance(s, ast.Expr))
            case ast.JoinedStr():  # read as a whole
                yield from (part for value in node.values for part in ast.walk(value))
            case ast.keyword(arg=name, value=value) if name in _TEXTS_OF_HELP:
                yield from ast.walk(value)


def _read(node: ast.AST) -> str:
    """Return the text of a literal, with ``{expression}`` for what is filled in; else nothing."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(map(_read, values))
        case ast.FormattedValue(value=value) if any(
            isinstance(part, ast.JoinedStr) for part in ast.walk(value)
        ):
            return "{nested}"  # a literal in a literal
        case ast.FormattedValue(value=value):
            return f"{{{re.sub('[{}]', '', ast.unparse(value))}}}"
    return ""


def list_extras() -> Iterator[tuple[str, str]]:
    """Yield the extras that ``require_extra`` tells to install, each with a place."""
    for file in source_files():
        for extra in re.findall(
            r"require_extra\(\s*\"([^\"]*)\"", file.read_text(encoding="utf-8")
        ):
            yield extra, str(file.relative_to(ROOT))

"""Collects from the source what messages propose to type, and finds it in a message.

No mark is needed: in a message, a word with ``=``, a word that begins with ``--``, and a line that
begins with ``evoros`` or another program is what a user types. Values that a message fills in
appear here as ``{expression}``.
"""

import ast
import re
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from helpers import ROOT

from evoros.files.plugins import find_plugins

_FILLED = r"\{[^{}]*\}"
_LIST = rf"\[(?:[^\[\]]|\[[^\]]*\]|{_FILLED})*\]"
_VALUE = rf"(?:\"[^\"]*\"|{_LIST}|[a-z]+\([^)]*\)|(?:{_FILLED}|[^\s;,)'\"`])+)"
_KEY = rf"(?:\+\+?|~)?(?:[a-z_]\w*|{_FILLED})(?:[.@/](?:\w|{_FILLED})+)*"
OVERRIDE = re.compile(rf"(?<![\w./<\"{{}}%@-])({_KEY})=({_VALUE})")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
COMMAND = re.compile(r"\bevoros ([a-z]+)(?: ([a-z]+))?")
INSTALL = re.compile(r"pip install '?([\w{}-]+(?:\[[^\]]+\])?)")
_EXTRA = re.compile(r"require_extra\(\s*\"([^\"]*)\"")
_TEXTS_OF_HELP = ("help", "usage", "epilog", "description", "metavar")

NOT_TYPED: Mapping[str, str] = {
    r"[\w.]+=[^ ]*:": "the subject of the message: the choice that cannot be used",
    r"(hydra/)?\{?\w+\}?=\{(path|run|source|jobs.plugins\[plugin\])\}:?": "the same",
    r"(key|column|known)=.*": "names the form",
    r"(time_step|x)=\{.*|record=\{(recorded|kept)\}": "states a value",
    r"(name|reference|type|effort|velocity|rpy)=.*": "an attribute of XML",
    r"(dtype|frozen|default|ensure_ascii|charset|key)=.*": "Python, or the head of a page",
    r"hydra/sweeper=optuna|hydra\.sweeper\.direction=.*": "of a plugin of Hydra",
    r"answer=.*": "states the choice of a ROS controller",
    r"core\.symlinks=true": "of git",
    r"\{p\}=.*": "a declaration of XML",
    r"\+?design\.sensors\.\{name\}\.(\{key\}|filters\.own_body)=.*": "typed in tests of preflight",
    r"completed=0.95|\{COMPLETED\}=0.05": "of a requirement and of --margin, which have tests",
    r"\{key\}=\{getattr\(chosen, key\)\}": "states what was found",
    r"navigation=serpentine": "states the controller of the paper",
    r"design=\{design\.name.*": "of inspect, whose line is typed in its test",
    r"failure\.sensors=.*map\(str, numbers\)\)\}\]": "of an action of osc.evoros",
}
"""Words with ``=`` that nobody types as they stand."""


class Message(NamedTuple):
    """A literal that a user may read."""

    place: str  # file and line
    text: str


def source_files() -> Iterator[Path]:
    """Yield the modules of the package."""
    for folder in ("evoros", "analysis"):
        files = sorted((ROOT / folder).rglob("*.py"))
        yield from (file for file in files if "tests" not in file.relative_to(ROOT).parts)


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


def key_of(message: Message) -> str:
    """The module of a message and the first override that it proposes; empty if it has none."""
    found = (match[0] for match in OVERRIDE.finditer(message.text))
    first = next((f for f in found if not any(re.fullmatch(p, f) for p in NOT_TYPED)), "")
    return f"{message.place.partition(':')[0]} {first.partition('=[')[0]}" if first else ""


@cache
def list_proposals(module: str = "") -> Mapping[str, str]:
    """Return the keys of the messages of a module, or of all, by message."""
    messages = tuple(_read_module(ROOT / module)) if module else list_messages()
    return {message.text: key for message in messages if (key := key_of(message))}


def list_named() -> set[str]:
    """List the keys that tests name, which provoke the message and type what it proposes."""
    tests = (*(ROOT / "tests").rglob("test_*.py"), *ROOT.glob("evoros/plugins/*/tests/test_*.py"))
    text = "\n".join(file.read_text(encoding="utf-8") for file in tests)
    return {key for key in list_proposals().values() if f'"{key}"' in text}


def list_alternatives(message: str, filled: Mapping[str, str]) -> list[list[str]]:
    """What a message proposes to type: the words of each alternative, with the user's names."""
    for name, value in filled.items():
        message = message.replace(name, value)
    parts = re.split(r",? or ", message.partition("; ")[2] or message)
    words = ([re.sub("[.:]$", "", match[0]) for match in OVERRIDE.finditer(part)] for part in parts)
    return [alternative for alternative in words if alternative]


def has_plugin(key: str) -> bool:
    """Return False if a key is of a message of a plug-in that is not there."""
    parts = key.split("/")
    return parts[1] != "plugins" or parts[2] in find_plugins()


def is_of(message: str, key: str) -> bool:
    """Return True if a message is one of those that the source has under a key.

    ``NAME`` may have been replaced by the name of a world, and lines may be broken.
    """
    proposals = list_proposals(key.partition(" ")[0])
    texts = [" ".join(text.split()) for text, other in proposals.items() if other == key]
    patterns = [".*".join(map(re.escape, re.split(r"\{[^{}]*\}|NAME|%\w", text))) for text in texts]
    return any(re.search(pattern, " ".join(message.split())) for pattern in patterns)


def replaces(chosen: Collection[str], word: str) -> bool:
    """Return True if the keys of proposals replace an override, or the choice that it is of."""
    key = word.lstrip("+~").partition("=")[0]
    return key in chosen or key.partition(".")[0] in chosen

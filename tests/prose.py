"""Finds prose in code, configuration and documents that breaks the rules of development."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
GENERATED = ("reference.md", "api.md", "api_analysis.md", "api_parts.md", "api_testing.md")
"""Pages that are made from docstrings, which are checked themselves."""
SUMMARY, TEXT, COMMENT, MESSAGE, PAGE = "summary", "docstring", "comment", "message", "page"
CODE = (SUMMARY, TEXT, COMMENT, MESSAGE)
EVERYWHERE = (*CODE, PAGE)


@dataclass(frozen=True)
class Passage:
    """A piece of prose and its place, such as ``evoros/base/rng.py:12``."""

    kind: str
    place: str
    text: str


@dataclass(frozen=True)
class Rule:
    """A pattern that must not occur in the given kinds of passages."""

    pattern: re.Pattern[str]
    kinds: tuple[str, ...]


def _rule(pattern: str, *kinds: str) -> Rule:
    return Rule(re.compile(pattern), kinds or EVERYWHERE)


_PREPOSITIONS = "of by with without in for as from at on to until than like between over under"
RULES = {
    "a summary is an imperative or a noun phrase": _rule(
        r"^(Whether|How|Where|What|Of|As|That|Those|Which|In|By|For|With|From|To)\b", SUMMARY
    ),
    "a comment does not begin with a preposition": _rule(
        rf"^(?i:{_PREPOSITIONS.replace(' ', '|')})\b", COMMENT
    ),
    "minimum or maximum": _rule(r"(?<!\bat )(?<!\bAt )\b(least|greatest)\b"),
    "the number of": _rule(r"\b([Hh]ow|[Ss]o) many\b"),
    "a noun in place of that of, those of": _rule(r"\b([Tt]hat|[Tt]hose) of\b"),
    "its own": _rule(r"\bof (its|their|his) own\b"),
    "another one": _rule(r"\b(is|are) of another\b"),
    "plain adverbs": _rule(r"\b([Aa]mid|[Aa]new|[Mm]eanwhile|[Ll]ikewise)\b"),
    "next to": _rule(r"\b[Bb]eside\b"),
    "despite": _rule(r"\b[Ii]n spite of\b"),
    "one whose in a sentence": _rule(r"\bwhose\b[^.]*\bwhose\b"),
    "one colon in a sentence": _rule(r": [a-z][^.:;|]*: [a-z]", SUMMARY, TEXT, COMMENT),
    "not found": _rule(r"\band (is none|has not|has none|is not one)\b", MESSAGE),
}
"""The rules of prose by what is asked for."""


def list_passages() -> Iterator[Passage]:
    """Yield the prose of the code, the configuration and the documents."""
    for folder in ("evoros", "analysis"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            if "tests" not in file.parts:
                yield from _read_module(file)
    for file in _list_files("conf", "yaml"):
        for number, line in enumerate(file.read_text().splitlines(), 1):
            if line.lstrip().startswith("#"):
                yield Passage(PAGE, _place(file, number), line.lstrip("# "))
    for file in (ROOT / "README.md", *_list_files("docs", "md")):
        if file.name not in GENERATED:
            yield from _read_page(file)


def _list_files(folder: str, suffix: str) -> list[Path]:
    """List the files of a folder and of the plug-ins, without their tests."""
    own = (ROOT / folder).rglob(f"*.{suffix}")
    plugins = (ROOT / "evoros/plugins").rglob(f"*.{suffix}")
    return sorted(file for file in (*own, *plugins) if "tests" not in file.parts)


def _place(file: Path, line: int) -> str:
    return f"{file.relative_to(ROOT)}:{line}"


def _read_module(file: Path) -> Iterator[Passage]:
    source = file.read_text()
    docstrings = set()
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                docstrings.add(id(value))
                place = _place(file, value.lineno)
                summary, _, rest = value.value.partition("\n")
                yield Passage(SUMMARY, place, summary)
                if rest.strip():
                    yield Passage(TEXT, place, " ".join(rest.split()))
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str) and id(node) not in docstrings and text.count(" ") >= 3:
            yield Passage(MESSAGE, _place(file, getattr(node, "lineno", 0)), text)
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT and not re.match(r"# (noqa|type:)", token.string):
            yield Passage(COMMENT, _place(file, token.start[0]), token.string.lstrip("# "))


def _read_page(file: Path) -> Iterator[Passage]:
    fenced = False
    for number, line in enumerate(file.read_text().splitlines(), 1):
        if line.startswith("```"):
            fenced = not fenced
        elif not fenced and line.strip():
            yield Passage(PAGE, _place(file, number), line)


def list_breaches(rule: Rule, passages: list[Passage]) -> list[str]:
    """List the places whose passages break a rule, with what they say."""
    return [
        f"{passage.place}: {passage.text[:90]}"
        for passage in passages
        if passage.kind in rule.kinds and rule.pattern.search(passage.text)
    ]

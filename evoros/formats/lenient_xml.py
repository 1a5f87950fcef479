"""Parses XML as leniently as Gazebo, repairing unambiguous errors and keeping line numbers."""

import logging
import re
from pathlib import Path

from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.strict_xml import parse

_LOG = logging.getLogger("evoros.xml")

_DECLARATION = re.compile(r"<\?xml\b[^>]*\?>")
_COMMENT = re.compile(r"(<!\[CDATA\[.*?\]\]>)|<!--.*?-->", re.DOTALL)
_AMPERSAND = re.compile(r"&(?!(?:#[0-9]+|#x[0-9a-fA-F]+|[A-Za-z_][\w.-]*);)")
_DOUBLE_COLON = re.compile(r"(</?[A-Za-z_][\w.-]*)::(?=[A-Za-z_])")
_TAG = re.compile(r"<([A-Za-z_][\w.-]*)(?::[\w.-]+)?(?:\s[^<>]*)?/?>")
_ATTRIBUTE = re.compile(r"\s([A-Za-z_][\w.-]*):[\w.-]+\s*=")
_ROOT = re.compile(r"<([A-Za-z_][^\s/>]*)")
_VALUE = r"\"[^\"]*+\"|'[^']*+'|[^\s\"'<>/]*+"
_ATTRIBUTES = re.compile(  # start tag of an element, with quoted or unquoted attributes
    rf"(<!\[CDATA\[.*?\]\]>)|(?<=<)[A-Za-z_][\w.:-]*+(?:\s++[\w.:-]++(?:\s*+=\s*+(?:{_VALUE}))?)++"
    r"(?=\s*/?>)",
    re.DOTALL,
)
_PAIR = re.compile(rf"(\s+)([\w.:-]++)(?:\s*+=\s*+({_VALUE}))?")
_ENCODING = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"']([A-Za-z0-9._-]+)")
_XACRO = "http://www.ros.org/wiki/xacro"
_KNOWN = {"xacro": _XACRO}


def is_xacro(file: Path, content: bytes) -> bool:
    """Return True if an SDF file requires expansion: its suffix is .xacro, or it declares xacro."""
    return file.suffix == ".xacro" or _XACRO.encode() in content


def parse_leniently(content: bytes, source: str) -> Element:
    """Parse a document like ``strict_xml.parse``, with repairs if necessary.

    Repairs are logged. They concern text, comments or a byte order mark before the XML declaration,
    anything after the root element, ``--`` in comments, attributes without quotes or without a
    value, undeclared prefixes, ``::`` in a tag, and unescaped ampersands.
    """
    try:
        return parse(content, source)
    except InputError:
        if b"<!DOCTYPE" in content:
            raise
        text, repairs = _repair(_decode(content))
        if not repairs:
            raise
    root = parse(text.encode(), source)
    _LOG.warning("%s: not well-formed XML (%s); the file is read as Gazebo reads it",
                 source, ", ".join(repairs))  # fmt: skip
    return root


def _decode(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    stated = _ENCODING.search(content)
    encoding = stated[1].decode() if stated else "utf-8"
    try:
        return content.decode(encoding).removeprefix("\ufeff")
    except (LookupError, UnicodeDecodeError):
        return content.decode("latin-1")


def _repair(text: str) -> tuple[str, list[str]]:
    repairs: list[str] = []

    def apply(repaired: str, slip: str) -> None:
        nonlocal text
        if repaired != text:
            text = repaired
            repairs.append(slip)

    declaration = _DECLARATION.search(text)
    if declaration is not None and declaration.start() > 0:
        before, after = text[: declaration.start()], text[declaration.end() :]
        apply(before + _lines(declaration[0]) + after, "content before the XML declaration")
    elif declaration is not None:  # the stated encoding does not apply to the decoded string
        text = _lines(declaration[0]) + text[declaration.end() :]
    if any("--" in comment[0][4:-3] for comment in _COMMENT.finditer(text) if not comment[1]):
        repairs.append("-- in a comment")
    text = _COMMENT.sub(lambda match: match[1] or _lines(match[0]), text)
    apply(_cut_after_root(text), "content after the root element")
    apply(_AMPERSAND.sub("&amp;", text), "& instead of &amp;")
    quoted = _ATTRIBUTES.sub(lambda tag: tag[1] or _PAIR.sub(_quote_value, tag[0]), text)
    apply(quoted, "attributes without quotes")
    apply(_DOUBLE_COLON.sub(r"\1:", text), ":: in an element name")
    prefixes = _undeclared_prefixes(text)
    if prefixes:
        spaces = "".join(f' xmlns:{p}="{_KNOWN.get(p, f"undeclared:{p}")}"' for p in prefixes)
        names = ", ".join(f"{prefix}:" for prefix in prefixes)
        apply(_ROOT.sub(lambda match: match[0] + spaces, text, count=1),
              f"prefixes without a declaration ({names})")  # fmt: skip
    return text, repairs


def _cut_after_root(text: str) -> str:
    """Return the XML up to the end of its first root element, as only that is read by Gazebo."""
    root, depth = _ROOT.search(text), 0
    name = re.escape(root[1]) if root else "(?!)"
    for tag in re.finditer(rf"<(/?){name}(?=[\s/>])[^<>]*?(/?)>", text):
        depth += 0 if tag[2] else -1 if tag[1] else 1
        if depth == 0:
            rest = text[tag.end() :]
            return text[: tag.end()] if rest.strip() else text
    return text


def _quote_value(pair: re.Match[str]) -> str:
    space, name, value = pair[1], pair[2], pair[3] or ""
    if value[:1] in ("'", '"'):
        return pair[0]
    return f'{space}{name}="{value}"{_lines(pair[0][len(space) :])}'


def _lines(text: str) -> str:
    return "\n" * text.count("\n")


def _undeclared_prefixes(text: str) -> list[str]:
    used: list[str] = []
    for tag in _TAG.finditer(text):
        prefix, colon, _ = tag[0][1:].split(None, 1)[0].rstrip("/>").partition(":")
        used += ([prefix] if colon else []) + _ATTRIBUTE.findall(tag[0])
    declared = set(re.findall(r"\sxmlns:([\w.-]+)\s*=", text)) | {"xml", "xmlns"}
    return [prefix for prefix in dict.fromkeys(used) if prefix not in declared]

"""Strict XML: what cannot be understood is an error with file, line and element."""

import itertools
import logging
import math
import re
from collections.abc import Callable

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.errors import InputError

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_LARGEST = 1e9  # no length, mass or angle is larger; so no product of two overflows
_LONGEST = 60  # characters of a value that a message shows


def parse(content: bytes, source: str) -> Element:
    """The root of a document; comments and processing instructions are left out.

    Nothing outside the document is read and no entity is expanded.

    Raises:
        InputError: not well-formed, or it has a DOCTYPE.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
        huge_tree=False,
    )
    try:
        root = etree.fromstring(content, parser, base_url=source)
    except (etree.XMLSyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        reason = " ".join(str(error).split())
        raise InputError(f"{source}:{line}: not well-formed XML: {reason}; correct it") from None
    if root.getroottree().docinfo.doctype:
        # It can define entities, which read files and grow without bound.
        line = content[: content.find(b"<!DOCTYPE") + 1].count(b"\n") + 1
        raise InputError(f"{source}:{line}: a DOCTYPE is not accepted; delete it")
    return root


def fault(element: Element, problem: str, cure: str) -> InputError:
    """The error for an element, to be raised by the caller."""
    return InputError(f"{_place(element)} {problem}; {cure}")


def warn(log: logging.Logger, element: Element, what: str) -> None:
    """Report an element that the reader leaves out although it may mean something."""
    log.warning("%s %s", _place(element), what)


def _place(element: Element) -> str:
    source = element.getroottree().docinfo.URL
    owners = [
        f" of {local_tag(owner)} {shown(owner.get('name', ''))}"
        for owner in itertools.chain([element], element.iterancestors())
        if owner.get("name") is not None
    ]
    return f"{source}:{element.sourceline}: <{local_tag(element)}>{''.join(owners)}"


def local_tag(element: Element) -> str:
    """The tag as it is written, with its prefix."""
    name = etree.QName(element).localname
    return f"{element.prefix}:{name}" if element.prefix else name


def shown(text: str) -> str:
    """A value in quotes, on one line and not too long for a message."""
    return repr(text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "...")


def child(element: Element, tag: str) -> Element | None:
    """The one child of this name, or None.

    Raises:
        InputError: there are several.
    """
    found = element.findall(tag)
    if len(found) > 1:
        raise fault(
            found[1], f"is given {len(found)} times in <{local_tag(element)}>", "keep one of them"
        )
    return found[0] if found else None


def needed(element: Element, tag: str) -> Element:
    """The one child of this name.

    Raises:
        InputError: there is none, or several.
    """
    found = child(element, tag)
    if found is None:
        raise fault(element, f"must have a <{tag}>", f"add a <{tag}>")
    return found


def text_of(element: Element) -> str:
    """The text of an element that has nothing but text."""
    if len(element):
        raise fault(element[0], f"must not stand inside <{local_tag(element)}>", "delete it")
    return (element.text or "").strip()


def name_of(element: Element) -> str:
    """The attribute ``name``, which must not be empty."""
    name = element.get("name", "").strip()
    if not name:
        raise fault(element, "must have a name", 'add the attribute name="..."')
    return name


def numbers(element: Element, *counts: int) -> tuple[float, ...]:
    """The numbers in an element; there must be as many as one of ``counts``."""
    words = text_of(element).split()
    if len(words) not in counts:
        expected = " or ".join(map(str, counts))
        text = shown(text_of(element))
        cure = f"write {expected} numbers separated by spaces"
        raise fault(element, f"must have {expected} numbers, not {len(words)}: {text}", cure)
    values = tuple(float(word) if _NUMBER.fullmatch(word) else math.nan for word in words)
    for word, value in zip(words, values, strict=True):
        if not abs(value) <= _LARGEST:
            problem = f"must be made of numbers of at most {_LARGEST:g}, not {shown(word)}"
            raise fault(element, problem, "correct it")
    return values


def number(element: Element, rule: str, holds: Callable[[float], bool]) -> float:
    """The one number in an element; ``rule`` completes "must be ..."."""
    (value,) = numbers(element, 1)
    if not holds(value):
        raise fault(element, f"must be {rule}, not {value:g}", "set it to such a value")
    return value


def positive(element: Element, *counts: int) -> tuple[float, ...]:
    """The numbers in an element, all of them above 0."""
    values = numbers(element, *counts)
    if min(values) <= 0:
        shown_values = " ".join(f"{value:g}" for value in values)
        raise fault(element, f"must be greater than 0, not {shown_values}", "correct it")
    return values


def flag(element: Element) -> bool:
    """True or false, also written 1 or 0."""
    text = text_of(element).lower()
    if text not in ("true", "false", "1", "0"):
        raise fault(element, f"must be true or false, not {shown(text)}", "correct it")
    return text in ("true", "1")


def flag_attribute(element: Element, attribute: str) -> bool:
    """An attribute that is true or false; false if it is absent."""
    text = element.get(attribute, "false").strip().lower()
    if text not in ("true", "false", "1", "0"):
        problem = f"has {attribute}={shown(text)}, which is neither true nor false"
        raise fault(element, problem, "correct it")
    return text in ("true", "1")

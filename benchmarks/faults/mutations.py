"""Random mutations of text and bytes, as typing, programs and disks make them."""

import re
from collections.abc import Callable
from random import Random

Mutation = Callable[[bytes, Random], bytes]

NUMBERS = (
    "nan", "inf", "-inf", "1e999", "1e308", "-1", "0", "-0.0", "1e-320", "9" * 400, "", "0x10",
    "1_0", "1,5", "\u0663", "1e", "--1", "true", "null", "~", "[]", "{}", "${seed}",
)  # fmt: skip
WORDS = (
    "", "\x00", "\x1b[2J", "\u202e", "\ufeff", "\udcff", "&amp;", "&e;", "<!--", "]]>", "<![CDATA[",
    '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>', "../../..", "file:///dev/zero",
    "package://x/y", "a" * 5000, "*a", "&a", "!!python/object/apply:os.getcwd []", "- ", ": ", "\t",
    "\r", '"', "'", ",", "\n\n", "%s", "{0}", "${oc.env:HOME}", "???",
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?[0-9]+\.?[0-9]*(?:[eE][-+]?[0-9]+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]{2,}")
_ELEMENT = re.compile(rb"<([a-z_]+)[^<>]*/>|<([a-z_]+)[^<>]*>[^<>]*</\2>")


def _encode(text: str) -> bytes:
    return text.encode(errors="surrogatepass")


def change_number(content: bytes, rng: Random) -> bytes:
    """Replace a number."""
    return _replace(_NUMBER, content, _encode(rng.choice(NUMBERS)), rng)


def change_word(content: bytes, rng: Random) -> bytes:
    """Replace a word by another one of the same file, or by a strange one."""
    words = _WORD.findall(content)
    word = rng.choice(words) if words and rng.random() < 0.6 else _encode(rng.choice(WORDS))
    return _replace(_WORD, content, word, rng)


def _replace(pattern: re.Pattern[bytes], content: bytes, by: bytes, rng: Random) -> bytes:
    found = list(pattern.finditer(content))
    if not found:
        return insert_word(content, rng)
    match = rng.choice(found)
    return content[: match.start()] + by + content[match.end() :]


def insert_word(content: bytes, rng: Random) -> bytes:
    """Insert a strange word anywhere."""
    at = rng.randint(0, len(content))
    return content[:at] + _encode(rng.choice(WORDS)) + content[at:]


def move_element(content: bytes, rng: Random) -> bytes:
    """Repeat an element of XML, or a span of other text, elsewhere; or delete it."""
    found = [match.span() for match in _ELEMENT.finditer(content)]
    begin, end = rng.choice(found) if found else _choose_span(content, rng)
    span, rest = content[begin:end], content
    if rng.random() < 0.5:
        rest = content[:begin] + content[end:]
    places = [start for start, _ in found] or [rng.randint(0, len(rest))]
    at = rng.choice(places)
    return rest if rng.random() < 0.3 else rest[:at] + span + rest[at:]


def move_line(content: bytes, rng: Random) -> bytes:
    """Delete, repeat or move a line, or indent it."""
    lines = content.splitlines(keepends=True) or [b"\n"]
    line = lines.pop(rng.randrange(len(lines)))
    for _ in range(rng.choice((0, 1, 1, 2))):
        lines.insert(rng.randint(0, len(lines)), rng.choice((line, b"  " + line, line.lstrip())))
    return b"".join(lines)


def flip_bits(content: bytes, rng: Random) -> bytes:
    """Flip some bits."""
    changed = bytearray(content or b"\n")
    for _ in range(rng.choice((1, 1, 4, 32))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def cut_span(content: bytes, rng: Random) -> bytes:
    """Cut a span out, or the end off."""
    begin, end = _choose_span(content, rng)
    return content[:begin] + (content[end:] if rng.random() < 0.7 else b"")


def nest(content: bytes, rng: Random) -> bytes:
    """Insert brackets or tags in great numbers."""
    at = rng.randint(0, len(content))
    text = rng.choice((b"[", b"{a: ", b"<model name='m'>", b"<link>", b"(", b"- ", b"${"))
    return content[:at] + text * rng.choice((10, 300, 5000)) + content[at:]


def recode(content: bytes, rng: Random) -> bytes:
    """Save in another encoding or with other line ends."""
    text = content.decode(errors="replace")
    choice = rng.choice(("utf-16", "utf-8-sig", "latin-1", "lines", "old lines"))
    if "lines" in choice:
        return content.replace(b"\n", b"\r\n" if choice == "lines" else b"\r")
    return text.encode(choice, errors="replace")


def _choose_span(content: bytes, rng: Random) -> tuple[int, int]:
    begin = rng.randint(0, len(content))
    return begin, min(len(content), begin + rng.choice((1, 8, 60, 500)))


MUTATIONS: tuple[Mutation, ...] = (
    change_number, change_number, change_number, change_word, change_word, insert_word,
    move_element, move_element, move_line, flip_bits, cut_span, nest, recode,
)  # fmt: skip


def mutate(content: bytes, rng: Random) -> bytes:
    """Apply some mutations, mostly one."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        content = rng.choice(MUTATIONS)(content, rng)
    return content

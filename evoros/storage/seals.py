"""Digests by which damage is noticed: at the end of a table's row, and inside a JSON file.

A bad disk may change any byte. A row whose digest does not match is damaged; a last row without a
line break is one that a kill or a loss of power has cut short. Rows that belong to one run have the
key of that run in their digests, so that those of another run do not match.
"""

import io
import json
from base64 import b32encode
from collections.abc import Iterable, Mapping
from hashlib import blake2b
from typing import Any

from evoros.files.nested import parse_json

DIGEST = "digest"
"""The last column of a sealed table, and the last field of a sealed JSON file."""
SIZE = 16  # letters and digits of a digest
OTHER_CONTENT = "its digest is of another content"
_BLANK = b"-" * SIZE


def compute_digest(content: bytes, key: bytes = b"") -> str:
    """Return 80 bits of BLAKE2b as 16 letters and digits, which no program takes for a number."""
    return b32encode(blake2b(content, digest_size=10, key=key).digest()).decode()


def split_lines(content: bytes) -> list[bytes]:
    """Return the lines with their line breaks, which are newlines alone."""
    return io.BytesIO(content).readlines()


def seal_rows(text: str, key: bytes = b"") -> bytes:
    """Return rows of CSV with the digest of each as its last cell."""
    lines = (line.encode() for line in text.split("\n")[:-1])
    return b"".join(b"%b,%b\n" % (line, compute_digest(line, key).encode()) for line in lines)


def is_sealed(line: bytes, key: bytes = b"") -> bool:
    """Whether a line of a table, with its line break, has the digest of its other cells."""
    if not line.endswith(b"\n"):
        return False
    row, _, digest = line[:-1].rpartition(b",")
    return digest == compute_digest(row, key).encode()


def is_damaged(line: bytes, key: bytes = b"") -> bool:
    """Whether a line that is not sealed is damaged, and not the cut end of a table."""
    return line.endswith(b"\n") or is_sealed(line[:-1] + b"\n", key)


def seal_json(name: str, content: Mapping[str, Any]) -> str:
    """Return a JSON object as text, whose last field is the digest of all others.

    The digest contains the ``name`` of the file, so that no other file takes its place.
    """
    text = json.dumps({**content, DIGEST: _BLANK.decode()}, indent=2) + "\n"
    head, _, tail = text.rpartition(_BLANK.decode())
    return f"{head}{compute_digest(text.encode(), name.encode())}{tail}"


def unseal_json(name: str, content: bytes, others: Iterable[str] = ()) -> dict[str, Any]:
    """Return the object in the sealed JSON file of this name, without its digest.

    ``others`` are names of files of which it may be a copy.

    Raises:
        ValueError: it is damaged.
    """
    fields = parse_json(content)
    begin = content.rfind(b'"digest": "') + len(b'"digest": "')
    blank = content[:begin] + _BLANK + content[begin + SIZE :]
    digest = content[begin : begin + SIZE].decode(errors="replace")
    if digest != compute_digest(blank, name.encode()):
        copied = (other for other in others if digest == compute_digest(blank, other.encode()))
        raise ValueError(next((f"it is a {other}" for other in copied), OTHER_CONTENT))
    if not isinstance(fields, dict):
        raise ValueError("it is no JSON object")
    return {name: value for name, value in fields.items() if name != DIGEST}

"""Digests that detect damage, at the end of a table row or inside a JSON file.

A row with a wrong digest is damaged; a last row without a line break was truncated by a kill or a
power failure. Digests of a run's rows include its key, so that rows of other runs do not match.
"""

import io
import json
from base64 import b32encode
from collections.abc import Iterable, Mapping
from hashlib import blake2b
from typing import Any

from evoros.files.nested import parse_json

DIGEST = "digest"
"""Last column of a sealed table, and last field of a sealed JSON file."""
SIZE = 16  # number of characters of a digest
_BLANK = b"-" * SIZE


def compute_digest(content: bytes, key: bytes = b"") -> str:
    """Return 80 bits of BLAKE2b as 16 letters and digits, which no program reads as a number."""
    return b32encode(blake2b(content, digest_size=10, key=key).digest()).decode()


def split_lines(content: bytes) -> list[bytes]:
    """Return the lines with their line breaks, split only at newlines."""
    return io.BytesIO(content).readlines()


def seal_rows(text: str, key: bytes = b"") -> bytes:
    """Return CSV rows with their digests as last cells."""
    lines = (line.encode() for line in text.split("\n")[:-1])
    return b"".join(b"%b,%b\n" % (line, compute_digest(line, key).encode()) for line in lines)


def is_sealed(line: bytes, key: bytes = b"") -> bool:
    """Return True if a line, including its line break, has the digest of its other cells."""
    if not line.endswith(b"\n"):
        return False
    row, _, digest = line[:-1].rpartition(b",")
    return digest == compute_digest(row, key).encode()


def is_damaged(line: bytes, key: bytes = b"") -> bool:
    """Return True if an unsealed line is damaged, and not the truncated end of a table."""
    return line.endswith(b"\n") or is_sealed(line[:-1] + b"\n", key)


def seal_json(name: str, content: Mapping[str, Any]) -> str:
    """Return a JSON object with the digest of all fields as its last field.

    The digest includes the ``name`` of the file, so that no other file can replace it.
    """
    text = json.dumps({**content, DIGEST: _BLANK.decode()}, indent=2) + "\n"
    head, _, tail = text.rpartition(_BLANK.decode())
    return f"{head}{compute_digest(text.encode(), name.encode())}{tail}"


def unseal_json(name: str, content: bytes, others: Iterable[str] = ()) -> dict[str, Any]:
    """Return the object in the sealed JSON file ``name``, without its digest.

    ``others`` are names of files that may have been copied over it.

    Raises:
        ValueError: the file is damaged.
    """
    fields = parse_json(content)
    begin = content.rfind(b'"digest": "') + len(b'"digest": "')
    blank = content[:begin] + _BLANK + content[begin + SIZE :]
    digest = content[begin : begin + SIZE].decode(errors="replace")
    if digest != compute_digest(blank, name.encode()):
        copied = (other for other in others if digest == compute_digest(blank, other.encode()))
        problem = next((f"it is a {other}" for other in copied), "its digest does not match")
        raise ValueError(problem)
    if not isinstance(fields, dict):
        raise ValueError("it is not a JSON object")
    return {name: value for name, value in fields.items() if name != DIGEST}

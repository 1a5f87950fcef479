"""The key of a run in the digests of its rows, so that rows of other runs never match."""

import json
import re
from collections.abc import Iterator, Mapping
from hashlib import blake2b
from typing import Any

from evoros.files.nested import parse_yaml
from evoros.files.private import hash_secret, is_other_secret
from evoros.mission.plan import GENERATIONS, find_growing
from evoros.observers import protocol
from evoros.storage.layout import DESIGN_FILE

KEY, STATUS_KEY = "rows", "run"  # names of the key in the manifest's digests and in ``status.json``
FREE = (*protocol.FREE, "figures", "record")  # configuration keys without effect on mission rows
_OWN_HASHES = "configuration"  # name prefix of digests that include the executor
_CALL = re.compile(r"(?<!\\)\$\{[\w.-]+:")  # resolver calls in recorded files refer to secrets


def derive_key(values: Mapping[str, Any], hashes: Mapping[str, str]) -> str:
    """Derive the key from the configuration (without executor and size) and other digests."""
    tree = json.loads(json.dumps(values, default=str), parse_float=_read_number)
    for name in FREE:
        tree.pop(name, None)
    growing = [GENERATIONS]
    if DESIGN_FILE in hashes:  # only evaluations have this file
        growing.append(find_growing(tree))
    for key in growing:
        group, _, name = key.rpartition(".")
        inner = tree.get(group) if group else tree
        if isinstance(inner, dict):
            inner.pop(name, None)
    sources = {key: value for key, value in hashes.items() if not key.startswith(_OWN_HASHES)}
    text = json.dumps([tree, sources], sort_keys=True)
    return blake2b(text.encode(), digest_size=32).hexdigest()


def conceal(values: Mapping[str, Any], config: str) -> Mapping[str, Any]:
    """Return the values or, if they contain secrets (which could be guessed), the parsed YAML."""
    tree = _parse_sources(config)
    return values if next(_list_secrets(tree, values), None) is None else tree


def hash_secrets(values: Mapping[str, Any], config: str) -> dict[str, str]:
    """Return digests of the secret values, which the YAML lacks, by dotted key."""
    secrets = _list_secrets(_parse_sources(config), values)
    return {key: hash_secret(json.dumps(value, default=str)) for key, value in secrets}


def list_other_secrets(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """List the keys of differing secrets, if both were hashed by the same user."""
    return [key for key in one if is_other_secret(one[key], other.get(key, ""))]


def _parse_sources(config: str) -> dict[str, Any]:
    """Parse the part of a configuration that affects rows; {} without references to secrets."""
    tree = parse_yaml(config) if _CALL.search(config) else {}
    return {name: node for name, node in tree.items() if name not in FREE}


def _list_secrets(node: Any, value: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(node, dict):
        for name, inner in node.items():
            yield from _list_secrets(inner, value[name], f"{above}.{name}" if above else name)
    elif _CALL.search(json.dumps(node, default=str)):
        yield above, value


def _read_number(text: str) -> float | int:
    value = float(text)
    return int(value) if value.is_integer() else value


def is_foreign(status: Mapping[str, Any], manifest: Mapping[str, Any]) -> bool:
    """Return True if ``status.json`` belongs to a different run than the manifest."""
    key = read_status_key(manifest)
    return bool(status.get(STATUS_KEY, key) != key)


def read_status_key(manifest: Mapping[str, Any]) -> str:
    """Return the manifest's key as written in ``status.json``."""
    return read_key(manifest).decode(errors="replace")


def read_key(manifest: Mapping[str, Any]) -> bytes:
    """Return the manifest's key; empty if missing."""
    hashes = manifest.get("sha256")
    recorded = hashes.get(KEY) if isinstance(hashes, dict) else None
    return (recorded or "").encode()[:64]  # maximum length for BLAKE2b; only forged keys are longer

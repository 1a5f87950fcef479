"""The key of a run or an evaluation, which the digest of each row of its missions contains.

A row of another run, whose missions met other circumstances, thus counts as damaged.
"""

import json
from collections.abc import Mapping
from hashlib import blake2b
from typing import Any

from evoros.files.nested import parse_yaml
from evoros.observers import protocol

KEY = "rows"
"""Name of the key among the hashes of the manifest."""
STATUS_KEY = "run"
"""Name of the key in the status."""
FREE = (*protocol.FREE, "figures", "record")
"""Groups of keys of the configuration on which no row depends."""
EXTENDABLE = ("optimizer", "generations")
"""The key that may grow when a run is resumed."""
_OWN_HASHES = "configuration"  # with the executor; hashes of it begin with this


def derive_key(values: Mapping[str, Any], hashes: Mapping[str, str]) -> str:
    """Derive the key from the configuration, with its references resolved, and other hashes.

    Equal runs have equal keys, whatever executes them and however far they are extended.
    """
    tree = json.loads(json.dumps(values, default=str), parse_float=_read_number)
    for name in FREE:
        tree.pop(name, None)
    group, name = EXTENDABLE
    if isinstance(tree.get(group), dict):
        tree[group].pop(name, None)
    sources = {key: value for key, value in hashes.items() if not key.startswith(_OWN_HASHES)}
    text = json.dumps([tree, sources], sort_keys=True)
    return blake2b(text.encode(), digest_size=32).hexdigest()


def conceal(values: Mapping[str, Any], config: str) -> Mapping[str, Any]:
    """Return the values with their references unresolved if these lead to the environment.

    ``config`` is the YAML of the configuration. A secret that is short could be guessed by the key.
    """
    if not names_environment(config):
        return values
    tree = {name: node for name, node in parse_yaml(config).items() if name not in FREE}
    return tree if names_environment(json.dumps(tree, default=str)) else values


def names_environment(config: str) -> bool:
    """Whether a configuration refers to variables of the environment."""
    return "oc.env" in config


def _read_number(text: str) -> float | int:
    """Read a number; a whole one is the same however it was typed."""
    value = float(text)
    return int(value) if value.is_integer() else value


def is_foreign(status: Mapping[str, Any], manifest: Mapping[str, Any]) -> bool:
    """Whether a status is of another run than the manifest."""
    key = read_status_key(manifest)
    return bool(status.get(STATUS_KEY, key) != key)


def read_status_key(manifest: Mapping[str, Any]) -> str:
    """Read the key from a manifest, as the status has it."""
    return read_key(manifest).decode(errors="replace")


def read_key(manifest: Mapping[str, Any]) -> bytes:
    """Read the key from a manifest; empty if it has none."""
    hashes = manifest.get("sha256")
    recorded = hashes.get(KEY) if isinstance(hashes, dict) else None
    return (recorded or "").encode()[:64]  # BLAKE2b takes no longer one, which only a forger writes

"""The types of the fields of sealed JSON files, whoever has written these."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from evoros.storage.seals import unseal_json

NAMES = ("manifest.json", "status.json")
"""Names of the sealed files."""


class _Kind(NamedTuple):
    text: str  # completes "must be ..."
    holds: Callable[[Any], bool]


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_text_or_null(value: object) -> bool:
    return value is None or isinstance(value, str)


_TEXT = _Kind("a text", _is_text)
_TEXT_OR_NULL = _Kind("a text or null", _is_text_or_null)
_FLAG = _Kind("true or false", lambda v: isinstance(v, bool))
_FLAG_OR_NULL = _Kind("true, false or null", lambda v: v is None or isinstance(v, bool))
_WHOLE = _Kind("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool))
_NUMBER_OR_NULL = _Kind(
    "a number or null",
    lambda v: v is None or (isinstance(v, int | float) and not isinstance(v, bool)),
)
_TEXTS = _Kind("a list of texts", lambda v: isinstance(v, list) and all(map(_is_text, v)))
_OBJECT = _Kind("an object", lambda v: isinstance(v, dict))
_OBJECT_OF_TEXTS = _Kind(
    "an object of texts", lambda v: isinstance(v, dict) and all(map(_is_text_or_null, v.values()))
)

_MANIFEST = {
    **dict.fromkeys(("format_version", "seed"), _WHOLE),
    **dict.fromkeys(("command", "created", "working_directory", "record"), _TEXT),
    **dict.fromkeys(
        ("commit", "config_dir", "sweep", "python", "platform", "operating_system", "processor"),
        _TEXT_OR_NULL,
    ),
    **dict.fromkeys(("agents", "simulators", "overrides"), _TEXTS),
    **dict.fromkeys(("packages", "programs", "sha256"), _OBJECT_OF_TEXTS),
    "choices": _OBJECT,
    **dict.fromkeys(("states_cases", "fails_parts", "walkers", "states_shortest"), _FLAG),
    "dirty": _FLAG_OR_NULL,
}
_STATUS = dict.fromkeys(("state", "reason", "run", "updated"), _TEXT)
"""All other fields of a status are numbers or null."""


def unseal(name: str, content: bytes) -> dict[str, Any]:
    """Return the fields of a sealed file, ``manifest.json`` or ``status.json``.

    Raises:
        ValueError: it is damaged, or a field has another type than evoros gives it.
    """
    fields = unseal_json(name, content, NAMES)
    for key, value in fields.items():
        kind = _find_kind(name, key)
        if kind is not None and not kind.holds(value):
            raise ValueError(f"{key} must be {kind.text}, not {value!r:.40}")
    return fields


def _find_kind(name: str, key: str) -> _Kind | None:
    kinds: Mapping[str, _Kind] = _MANIFEST if name == "manifest.json" else _STATUS
    return kinds.get(key, _NUMBER_OR_NULL if kinds is _STATUS else None)

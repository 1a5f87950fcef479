"""Resolves references in a configuration, so that the recorded configuration has the values used.

References ``${key}`` remain unresolved, and so do possible secrets: environment variables named
like secrets, strings at keys named like secrets or passed to other programs, and addresses with a
password.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from hydra import utils
from omegaconf import DictConfig, OmegaConf
from omegaconf.resolvers import oc

from evoros.base.errors import InputError
from evoros.config.messages import describe_error, find_unresolved
from evoros.files.private import SECRET

IS_LATER = hasattr(utils, "execution_whitelist")  # whether Hydra is 1.4 or later
_KEY = re.compile(r"\$\{\w[\w.]*\}")  # reference to another key, which an analysis can resolve
_OF_OTHERS = re.compile(r"\$\{(?!oc\.|now:|hydra:)[\w.-]+:")  # call of another library's resolver
_OUTSIDE = re.compile(
    r"(^|\.)(environment|command|nodes)(\.|$)|^controller\.arguments\b|^observers\."
)
"""Keys with values that are passed to other programs."""
_ADDRESS = re.compile(r"://[^/\s]*@")
_HIDDEN = "${evoros.secret:}"  # unknown resolver, which keeps references from being resolved
_Place = tuple[Any, Any, str, str]  # mapping or list, key or index in it, dotted key, string


def settle(config: DictConfig) -> tuple[str, dict[str, Any]]:
    """Return a configuration as YAML to record, and its values."""
    try:
        _settle(config)
    except Exception as error:  # a resolver returned a value that YAML cannot represent
        raise InputError(describe_error(error)) from error
    return OmegaConf.to_yaml(config, resolve=False), resolve(config)


def has_calls(config: DictConfig) -> bool:
    """Return True if any reference is more than ``${key}``, so that it may depend on other keys."""
    raw = OmegaConf.to_container(config, resolve=False)
    return any(name.split(".")[0] != "hydra" for _, _, name, _ in _list_places(config, raw))


def is_private(key: str) -> bool:
    """Return True if a string from the environment at a dotted key may be a secret."""
    return bool(_OUTSIDE.search(key) or SECRET.search(key))


def resolve(config: DictConfig) -> dict[str, Any]:
    """Return the values of a configuration, with references resolved."""
    try:
        values = OmegaConf.to_container(config, resolve=True)
    except Exception as error:  # resolvers may raise any exception
        key, message = find_unresolved(config), describe_error(error)
        named = not key or re.sub(r"\[(\d+)\]", r".\1", message).startswith(f"{key}: ")
        raise InputError(message if named else f"{key}: {message}") from error
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items()}


def register_resolver(name: str, resolver: Any) -> None:
    """Register a resolver, with the function of the installed OmegaConf."""
    method = "register_resolver" if IS_LATER else "register_new_resolver"
    getattr(OmegaConf, method)(name, resolver, replace=True)


def _settle(config: DictConfig) -> None:
    """Replace references with values, starting with references without ``${key}``."""
    raw = OmegaConf.to_container(config, resolve=False)
    places = sorted(_list_places(config, raw), key=lambda place: bool(_KEY.search(place[3])))
    secrets: list[_Place] = []
    for place in places:
        above, key, _, _ = place
        try:
            value = _read(place)
        except Exception:  # a secret, or an unresolvable reference, which ``resolve`` reports
            secrets.append(place)
            above[key] = _HIDDEN
        else:
            above[key] = map_texts(value, _escape)
    for above, key, _, text in secrets:
        above[key] = text


def _list_places(node: Any, raw: Any, above: str = "") -> Iterator[_Place]:
    """Yield the references that are more than ``${key}``; ``raw`` is the unresolved node."""
    for key, value in raw.items() if isinstance(raw, dict) else enumerate(raw):
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, dict | list):
            yield from _list_places(node[key], value, name)
        elif isinstance(value, str) and "${" in value and not _KEY.fullmatch(value):
            yield node, key, name, value


def _read(place: _Place) -> Any:
    """Return the value of a reference; raise a LookupError if it may be a secret."""
    above, key, name, text = place
    if _OF_OTHERS.search(text) and (SECRET.search(text) or SECRET.search(name)):
        raise LookupError(name)
    with _hide_variables() as names:
        value = above[key]
        plain = OmegaConf.to_container(value, resolve=True) if OmegaConf.is_config(value) else value
    texts = '"' in (written := json.dumps(plain, default=str))
    if (names and texts and is_private(name)) or _ADDRESS.search(written):
        raise LookupError(name)
    return plain


@contextmanager
def _hide_variables() -> Iterator[set[str]]:
    """Raise a LookupError for secret variables, even with a default; collect other names."""
    names: set[str] = set()

    def read(name: str, *default: Any) -> str | None:
        if SECRET.search(name):
            raise LookupError(name)
        names.add(name)
        return oc.env(name, *default)

    register_resolver("oc.env", read)
    try:
        yield names
    finally:
        register_resolver("oc.env", oc.env)


def map_texts(node: Any, change: Callable[[str], str]) -> Any:
    """Apply ``change`` to all strings in a tree of values."""
    if isinstance(node, Mapping):
        return {key: map_texts(value, change) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [map_texts(value, change) for value in node]
    return change(node) if isinstance(node, str) else node


def _escape(text: str) -> str:
    return re.sub(r"(\\*)\$\{", r"\1\1\\${", text)

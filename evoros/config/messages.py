"""Turns errors of Hydra, OmegaConf, YAML and Python into one line: place, rule, value and fix."""

import re
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import Any

import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import (
    HydraException,
    InstantiationException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from evoros.base.errors import EvorosError, single_line

HELP = "see evoros --help for groups and keys"
LONGEST = 1000
"""The characters of a path or of a library's message that are shown; its middle is left out."""


def describe_error(error: BaseException) -> str:
    """Describe an error in reading or composing a configuration."""
    cause = error.__cause__
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
        mark = error.problem_mark
        return (
            f"{mark.name}: line {mark.line + 1}, column {mark.column + 1}: must be valid YAML: "
            f"{error.problem}; correct the file"
        )
    if isinstance(error, MissingConfigException):
        return _no_such_choice(error)
    if isinstance(error, OverrideParseException):
        function = re.search(r"Unknown function '(\w+)'", str(error))
        if function:
            return (
                f"{error.override!r}: must call a function of Hydra's grammar, such as choice, "
                f"range and glob, not {function[1]}; correct or quote it"
            )
        return _describe_word(error.override or "")
    if isinstance(error, OSError) and error.filename:
        path, reason = _shorten(str(error.filename)), error.strerror or _flat(error)
        return f"{path}: {reason}; correct the path or its permissions"
    unknown = re.match(r"Could not override '(.*?)'", str(error))
    if unknown:
        return _no_such_key(unknown[1], cause)
    twice = re.search(
        r"Multiple values for ([^\s,]+?)\.? |^([^\s]+) appears more than once", str(error)
    )
    if twice:
        return _chosen_twice(twice[1] or twice[2])
    if isinstance(error, OmegaConfBaseException) and error.full_key:
        return f"{error.full_key}: {_flat(error)}; correct the value or the reference"
    if isinstance(cause, yaml.MarkedYAMLError):
        return describe_error(cause)
    return f"{_flat(error) or type(error).__name__}; {HELP}"


def describe_build_error(error: Exception) -> str:
    """Describe why an object could not be built, after the key that it was built from.

    Hydra 1.3 raises an error of its own with the key, later versions add a note to the error.
    """
    texts = [str(error), *getattr(error, "__notes__", ())]
    match = re.search(r"full_key: (\S+)", "\n".join(texts))
    key = match[1] if match else ""
    cause = _cause(error)
    if isinstance(cause, EvorosError):
        return _keyed(key, str(cause))
    where = f"{key}: " if key else ""
    if isinstance(cause, TypeError):
        return f"{where}{_signature(str(cause))}"
    missing = re.fullmatch(r"No module named '(.*)\.(\w+)'; '\1' is not a package", str(cause))
    if missing:
        return f"{where}the module {missing[1]} has no {missing[2]}; correct _target_"
    if isinstance(cause, ImportError | AttributeError):
        return (
            f"{where}{_flat(cause)}; correct _target_, or put the module into the folder given "
            f"with --config-dir"
        )
    if isinstance(cause, OmegaConfBaseException | OSError | yaml.YAMLError):
        return where + describe_error(cause)
    if isinstance(cause, SyntaxError):
        return f"{where}{cause.filename}, line {cause.lineno}: {cause.msg}; correct the code"
    if isinstance(cause, InstantiationException):  # Hydra itself refuses the class
        return f"{where}{_flat(cause)}; correct _target_"
    return f"{where}{type(cause).__name__}: {_flat(cause)}; correct the values, or the code"


def find_unresolved(config: DictConfig | ListConfig, above: str = "") -> str:
    """Find the first key whose reference ``${...}`` leads nowhere; empty if there is none."""
    keys = range(len(config)) if isinstance(config, ListConfig) else list(config)
    for key in keys:
        path = f"{above}.{key}" if above else str(key)
        if path == "hydra":
            continue
        try:
            child = config[key]
        except Exception:  # resolvers raise anything
            return path
        if isinstance(child, DictConfig | ListConfig) and (inner := find_unresolved(child, path)):
            return inner
    return ""


def _keyed(key: str, message: str) -> str:
    """Turn ``Class.field: ...`` into the key of the configuration, below the class's ``key``."""
    field = re.match(r"[A-Z]\w*\.(\w+): ", message)
    if field:
        rest = message[field.end() :]
        return f"{key}.{field[1]}: {rest}" if key else f"{field[1]}: {rest}"
    return f"{key}: {message}" if key and not message.startswith(key) else message


def _describe_word(word: str) -> str:
    """Describe a word that Hydra cannot parse, with the quotes that it lacks if they are all."""
    key, equals, value = word.partition("=")
    if equals and not value.isascii() and not re.search("[\"'()\\[\\]{}]", value):
        quoted = f'{key}="{value}"'
        with suppress(HydraException):
            OverridesParser.create().parse_override(quoted)
            return (
                f"{word!r}: the value must be in quotes of its own, because Hydra reads it, too; "
                f"type '{quoted}'"
            )
    return f"{word!r}: must be key=value in Hydra's grammar; correct or quote it"


def _chosen_twice(key: str) -> str:
    return (
        f"{key}: must be chosen once, and a default chooses it already; to replace its choice, "
        f"type {key}=... without +, or write 'override /{key}: ...' into the file's defaults"
    )


def _no_such_key(key: str, cause: BaseException | None) -> str:
    """Describe the override of a key that does not exist, with similar or neighbouring keys."""
    parent, missing = getattr(cause, "parent_node", None), str(getattr(cause, "key", key))
    above, *_ = key.split(f".{missing}") if f".{missing}" in key else [""]
    last = key.rpartition(".")[2]
    siblings = _list_keys(parent)
    if last in siblings:  # the key exists, and the one above it does not take values
        siblings = []
    rest = key.removeprefix(f"{above}.").split(".")
    corrected = _correct(parent, rest)
    below = [f"{name}.{last}" for name in siblings if last in _list_keys(_select(parent, name))]
    fix = HELP if not siblings else f"there is {', '.join(siblings)}"
    if below or corrected:
        proposed = below[0] if below else ".".join(corrected)
        fix = f"did you mean {f'{above}.' if above else ''}{proposed}"
    return f"{key}: must be an existing key; {fix}"


def _correct(config: Any, parts: Sequence[str]) -> list[str]:
    """Return the parts of the nearest existing key to a misspelt one; empty if none is near."""
    if not parts:
        return []
    first, *rest = parts
    for name in get_close_matches(first, _list_keys(config), 3):
        below = _correct(_select(config, name), rest)
        if below or not rest:
            return [name, *below]
    return []


def _list_keys(config: Any) -> list[str]:
    names = map(str, config) if isinstance(config, DictConfig) else ()
    return [name for name in names if name not in ("_target_", "hydra")]


def _select(config: Any, name: str) -> Any:
    return OmegaConf.select(config, name, throw_on_missing=False, throw_on_resolution_failure=False)


def _no_such_choice(error: MissingConfigException) -> str:
    """Describe a choice that its group does not have, with the choices that it has."""
    group, _, name = (error.missing_cfg_file or "").rpartition("/")
    choices = ", ".join(error.options or ())
    if not choices:
        match = re.match(r"In '(.*?)'", str(error))
        where = f" for the defaults of {match[1]}" if match else ""
        return f"{error.missing_cfg_file}: must be an existing file{where}; {HELP}"
    fix = "choose one of these"
    if group in ("hydra/launcher", "hydra/sweeper"):  # as the packages of all known plugins
        package = f"hydra-{name.partition('_')[0]}-{group.rpartition('/')[2]}"
        fix = f"install its plugin (pip install {package}), or {fix}"
    return f"{group}: must be one of {choices}, not {name!r}; {fix}"


def _flat(error: BaseException | None) -> str:
    """Return the message of an error in one line, without Hydra's lines of context."""
    noise = ("Config search path", "provider=", "Set the environment", "full_key:", "object_type=")
    lines = [line.strip() for line in str(error).splitlines()]
    kept = single_line(" ".join(line for line in lines if not line.startswith(noise)))
    return _shorten(kept.rstrip("."))


def _shorten(text: str) -> str:
    """Leave out the middle of a long text; its end often has the reason."""
    half = LONGEST // 2
    return text if len(text) <= LONGEST else f"{text[:half]} ... {text[-half:]}"


def _cause(error: BaseException) -> BaseException:
    """Return the innermost cause, or the outermost one that is an error of evoros."""
    cause = error
    while not isinstance(cause, EvorosError) and cause.__cause__ is not None:
        cause = cause.__cause__
    return cause


def _signature(message: str) -> str:
    """Describe wrong arguments in terms of keys."""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", message)
    if unknown:
        return f"unknown key {unknown[1]!r}; remove it or correct its spelling"
    missing = re.search(r"missing \d+ required .*?argument[s]?: (.*)", message)
    if missing:
        return f"missing key {missing[1]}; add it"
    return f"{single_line(message)}; correct the values"

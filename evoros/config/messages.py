"""One-line messages for errors of Hydra, OmegaConf, YAML and Python."""

import inspect
import re
import sys
from collections.abc import Collection, Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import Any

import yaml
from hydra import errors
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.utils import get_object
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from evoros.base.errors import EvorosError, override, shell_line, single_line
from evoros.config.own_files import locate_fault
from evoros.files.nested import read_yaml
from evoros.files.plugins import conf_folders, explain_missing

HELP = "see evoros --help for groups and keys"
LONGEST = 1000  # maximum length of a path or library message; longer ones lose their middle


def describe_error(error: BaseException) -> str:
    """Describe an error in reading or composing a configuration."""
    cause = error.__cause__
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
        mark = error.problem_mark
        return (
            f"{mark.name}: line {mark.line + 1}, column {mark.column + 1}: not valid YAML: "
            f"{error.problem}; correct the file"
        )
    if isinstance(error, errors.MissingConfigException):
        return _no_such_choice(error)
    if isinstance(error, errors.OverrideParseException):
        return _describe_word(error.override or "")
    if isinstance(error, OSError) and error.filename:
        path, reason = _shorten(str(error.filename)), error.strerror or _flat(error)
        return f"{path}: {reason}; correct the path or its permissions"
    twice = re.search(
        r"Multiple values for ([^\s,]+?)\.? |^([^\s]+) appears more than once", str(error)
    )
    if twice:
        key = twice[1] or twice[2]
        return (
            f"{key}: a default already makes this choice; to replace that "
            f"choice, type {key}=... without +, or put 'override /{key}: ...' in the defaults list "
            "of your file"
        )
    if isinstance(error, MissingMandatoryValue):
        return f"{error.full_key}: must be given; type {error.full_key}=..."
    if isinstance(error, OmegaConfBaseException) and error.full_key:
        return f"{error.full_key}: {_flat(error)}; correct the value or the reference"
    if isinstance(cause, yaml.MarkedYAMLError):
        return describe_error(cause)
    return f"{_flat(error) or type(error).__name__}; {HELP}"


def describe_build_error(error: BaseException) -> str:
    """Describe an error in the construction of an object, after its configuration key."""
    texts = [str(error), *getattr(error, "__notes__", ())]
    match = re.search(r"full_key: (\S+)", "\n".join(texts))
    key = match[1] if match else ""
    cause: BaseException = error  # outermost error of evoros, otherwise innermost error
    while not isinstance(cause, EvorosError) and cause.__cause__ is not None:
        cause = cause.__cause__
    if isinstance(cause, EvorosError):
        message = str(cause)
        if world := re.match(r".*\bworld\.\w+", key):
            # the world's configuration may lack the suggested keys, hence ``++``
            message = re.sub(r"world\.NAME\.(?=\w+=)", f"++{world[0]}.", message)
            message = message.replace("world.NAME.", f"{world[0]}.")
        return _keyed(key, message)
    where, place = f"{key}: " if key else "", locate_fault(error)
    if place and not isinstance(cause, ImportError | SyntaxError | OmegaConfBaseException):
        return f"{where}{place}{type(cause).__name__}: {_flat(cause)}; correct the code"
    module, _, name = ((isinstance(cause, ImportError) and cause.name) or "").rpartition(".")
    if module in sys.modules and not hasattr(sys.modules[module], "__path__"):
        return f"{where}the module {module} has no {name}; correct _target_"
    if isinstance(cause, ImportError | AttributeError):
        return (
            f"{where}{_flat(cause)}; correct _target_, or put the module into the folder given "
            f"with --config-dir"
        )
    if isinstance(cause, OmegaConfBaseException | OSError | yaml.YAMLError):
        return _keyed(key, describe_error(cause))
    if isinstance(cause, SyntaxError):
        return f"{where}{cause.filename}, line {cause.lineno}: {cause.msg}; correct the code"
    if isinstance(cause, errors.InstantiationException):  # Hydra rejects the class
        return f"{where}{_flat(cause)}; correct _target_"
    return f"{where}{type(cause).__name__}: {_flat(cause)}; correct the values, or the code"


def find_unresolved(config: DictConfig | ListConfig, above: str = "") -> str:
    """Return the first key with an unresolvable reference ``${...}``; empty if all resolve."""
    keys = range(len(config)) if isinstance(config, ListConfig) else list(config)
    for key in keys:
        path = f"{above}.{key}" if above else str(key)
        if path == "hydra":
            continue
        try:
            child = config[key]
        except Exception:  # a resolver may raise any exception
            return path
        if isinstance(child, DictConfig | ListConfig) and (inner := find_unresolved(child, path)):
            return inner
    return ""


def _keyed(key: str, message: str) -> str:
    """Replace ``Class.field: ...`` in a message with the dotted key of the field below ``key``."""
    field = re.match(r"[A-Z]\w*\.(\w+): ", message)
    if field:
        rest = message[field.end() :]
        return f"{key}.{field[1]}: {rest}" if key else f"{field[1]}: {rest}"
    return f"{key}: {message}" if key and not message.startswith(key) else message


def _describe_word(word: str) -> str:
    key, equals, value = word.partition("=")
    parser = OverridesParser.create()
    for name in re.findall(r"(\w+)\(", re.sub(r"[\"'].*", "", value)):
        if name not in parser.functions.functions:
            return (
                f"{word!r}: Hydra's grammar has no function {name}; use choice, range or glob, "
                "or quote the value"
            )
    unlike_keys = re.search("[=/]", value) or not value.isascii()
    if equals and unlike_keys and not re.search("[\"'()\\[\\]{}]", value):
        quoted = override(key, value)
        with suppress(errors.HydraException):
            parser.parse_override(quoted)
            return (
                f"{word!r}: the value needs inner quotes, because Hydra also parses it; "
                f"type {shell_line(quoted)}"
            )
    return f"{word!r}: must be key=value in Hydra's grammar; correct the word or quote the value"


def describe_unknown(config: DictConfig, key: str) -> str:
    """Describe an unknown typed key, and name similar keys; empty if it exists."""
    parts = key.split(".")
    parent: Any = config
    for place, part in enumerate(parts):
        if part not in _list_keys(parent, hidden=()):
            above = "".join(f"{name}." for name in parts[:place])
            return _no_such_key(key, parent, above, parts[place:])
        parent = _select(parent, part)
    return ""


def name_owners(group: str, name: str) -> str:
    """List bundled options of a group whose class has a parameter ``name``; may be empty."""
    found = []
    place = f"{group.replace('.', '/')}/*.yaml"
    files = (file for folder in conf_folders() for file in folder.glob(place))
    for path in sorted(files) if group else ():
        target = read_yaml(path)[0].get("_target_")
        if target and name in inspect.signature(get_object(target)).parameters:
            found.append(path.stem)
    return f"only {' or '.join(found)} in the group {group} has this key" if found else ""


def _no_such_key(key: str, parent: Any, above: str, rest: Sequence[str]) -> str:
    """Describe the missing key ``rest`` of the value ``parent``, whose key is ``above``."""
    siblings, last = _list_keys(parent), rest[-1]
    corrected = _correct(parent, rest)
    below = [f"{name}.{last}" for name in siblings if last in _list_keys(_select(parent, name))]
    fix = HELP if not siblings else f"the keys here are {', '.join(siblings)}"
    target = str(_select(parent, "_target_") or "")
    is_own = target.startswith("evoros.")
    if (
        parent is None
        or parent == {}
        or (is_own and last in inspect.signature(get_object(target)).parameters)
    ):
        return f"{key}: not in the configuration; to add it, type +{key}=..."
    group = above.rstrip(".")
    owners = name_owners(group, rest[0])
    if owners:
        fix = f"{owners}; leave the key out, or change the choice of {group}"
    elif below or corrected:
        fix = f"did you mean {above}{below[0] if below else '.'.join(corrected)}"
    return f"{key}: no such key; {fix}"


def _correct(config: Any, parts: Sequence[str]) -> list[str]:
    """Return the parts of the existing key closest to a misspelt key; empty if none is close."""
    if not parts:
        return []
    first, *rest = parts
    for name in get_close_matches(first, _list_keys(config), 3):
        below = _correct(_select(config, name), rest)
        if below or not rest:
            return [name, *below]
    return []


def _list_keys(config: Any, hidden: Collection[str] = ("_target_", "hydra")) -> list[str]:
    names = map(str, config) if isinstance(config, DictConfig) else ()
    return [name for name in names if name not in hidden]


def _select(config: Any, name: str) -> Any:
    if not isinstance(config, DictConfig):
        return None
    return OmegaConf.select(config, name, throw_on_missing=False, throw_on_resolution_failure=False)


def _no_such_choice(error: errors.MissingConfigException) -> str:
    group, _, name = (error.missing_cfg_file or "").rpartition("/")
    missing = explain_missing(f"{group}={name}")
    if missing:
        return missing
    choices = ", ".join(error.options or ())
    if not choices:
        match = re.match(r"In '(.*?)'", str(error))
        where = f" for the defaults of {match[1]}" if match else ""
        return f"{error.missing_cfg_file}: file not found{where}; {HELP}"
    fix = "choose one of these"
    if group in ("hydra/launcher", "hydra/sweeper"):  # the packages of all plugins have such names
        package = f"hydra-{name.partition('_')[0]}-{group.rpartition('/')[2]}"
        fix = f"install its plugin (pip install {package}), or {fix}"
    return f"{group}: must be one of {choices}, not {name!r}; {fix}"


def _flat(error: BaseException | None) -> str:
    """Return the message of an error on one line, without Hydra's context lines."""
    noise = ("Config search path", "provider=", "Set the environment", "full_key:", "object_type=")
    lines = [line.strip() for line in str(error).splitlines()]
    kept = single_line(" ".join(line for line in lines if not line.startswith(noise)))
    return _shorten(kept.rstrip("."))


def _shorten(text: str) -> str:
    half = LONGEST // 2
    # the reason is often at the end
    return text if len(text) <= LONGEST else f"{text[:half]} ... {text[-half:]}"

"""What Hydra, OmegaConf, YAML and Python say, in one line: where, the rule, the value, the cure."""

import re
from difflib import get_close_matches

import yaml
from hydra.errors import InstantiationException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, ListConfig
from omegaconf.errors import OmegaConfBaseException

from evoros.base.errors import EvorosError

HELP = "see evoros --help for groups and keys"


def one_line(error: BaseException) -> str:
    """The message for an error while the configuration is read or composed."""
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
        return f"{error.override!r}: must be key=value in Hydra's grammar; correct or quote it"
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror or error}; correct the path or its permissions"
    unknown = re.match(r"Could not override '(.*?)'", str(error))
    if unknown:
        return _no_such_key(unknown[1], cause)
    if isinstance(error, OmegaConfBaseException) and error.full_key:
        return f"{error.full_key}: {_flat(error)}; correct the value or the reference"
    if isinstance(cause, yaml.MarkedYAMLError):
        return one_line(cause)
    return f"{_flat(error) or type(error).__name__}; {HELP}"


def about_instantiation(error: InstantiationException) -> str:
    """The cause of a failed instantiation, behind the key where it happened."""
    found = re.search(r"full_key: (\S+)", str(error))
    key = found[1] if found else ""
    cause = _cause(error)
    if isinstance(cause, EvorosError):
        return _keyed(key, str(cause))
    where = f"{key}: " if key else ""
    if isinstance(cause, TypeError):
        return f"{where}{_signature(str(cause))}"
    absent = re.fullmatch(r"No module named '(.*)\.(\w+)'; '\1' is not a package", str(cause))
    if absent:
        return f"{where}the module {absent[1]} has no {absent[2]}; correct _target_"
    if isinstance(cause, ImportError | AttributeError):
        return (
            f"{where}{_flat(cause)}; correct _target_, or put the module into the folder given "
            f"with --config-dir"
        )
    if isinstance(cause, OmegaConfBaseException | OSError | yaml.YAMLError):
        return where + one_line(cause)
    if isinstance(cause, InstantiationException):  # Hydra itself refuses the class
        return f"{where}{_flat(cause)}; correct _target_"
    return f"{where}{type(cause).__name__}: {_flat(cause)}; correct the values"


def unresolved(config: DictConfig | ListConfig, above: str = "") -> str:
    """The first key whose reference ``${...}`` leads nowhere; empty where all lead somewhere."""
    keys = range(len(config)) if isinstance(config, ListConfig) else list(config)
    for key in keys:
        path = f"{above}.{key}" if above else str(key)
        if path == "hydra":
            continue
        try:
            child = config[key]
        except Exception:  # resolvers raise what they like
            return path
        if isinstance(child, DictConfig | ListConfig) and (inner := unresolved(child, path)):
            return inner
    return ""


def _keyed(key: str, message: str) -> str:
    """``Class.field: ...`` as the configuration's key, where the class is built from ``key``."""
    field = re.match(r"[A-Z]\w*\.(\w+): ", message)
    if field:
        rest = message[field.end() :]
        return f"{key}.{field[1]}: {rest}" if key else f"{field[1]}: {rest}"
    return f"{key}: {message}" if key and not message.startswith(key) else message


def _no_such_key(key: str, cause: BaseException | None) -> str:
    """An override of a key that is not there, and what is there."""
    last = key.rpartition(".")[2]
    parent = getattr(cause, "parent_node", None)
    there = [str(each) for each in parent] if isinstance(parent, DictConfig) else []
    there = [each for each in there if each not in ("_target_", "hydra")]
    if last in there:  # it is the key above that does not take values
        there = []
    close = get_close_matches(last, there, 1)
    below = [f"{each}.{last}" for each in there if _has(parent, each, last)]
    cure = HELP if not there else f"there is {', '.join(there)}"
    if close or below:
        cure = f"did you mean {(close or below)[0]}"
    return f"{key}: must be an existing key; {cure}"


def _has(config: DictConfig | None, group: str, key: str) -> bool:
    inner = config._get_node(group) if config is not None else None
    return isinstance(inner, DictConfig) and key in inner


def _no_such_choice(error: MissingConfigException) -> str:
    """A group without the chosen file; the message names the group and what it offers."""
    group, _, name = (error.missing_cfg_file or "").rpartition("/")
    choices = ", ".join(error.options or ())
    if not choices:
        found = re.match(r"In '(.*?)'", str(error))
        where = f" for the defaults of {found[1]}" if found else ""
        return f"{error.missing_cfg_file}: must be an existing file{where}; {HELP}"
    return f"{group}: must be one of {choices}, not {name!r}; choose one of these"


def _flat(error: BaseException | None) -> str:
    """In one line, without the lines that repeat or decorate."""
    noise = ("Config search path", "provider=", "Set the environment", "full_key:", "object_type=")
    lines = [line.strip() for line in str(error).splitlines()]
    kept = " ".join(line for line in lines if not line.startswith(noise))
    return re.sub(r"\s+", " ", kept).strip().rstrip(".")


def _cause(error: BaseException) -> BaseException:
    """The innermost cause; one of ours ends the search."""
    cause = error
    while not isinstance(cause, EvorosError) and cause.__cause__ is not None:
        cause = cause.__cause__
    return cause


def _signature(message: str) -> str:
    """A readable line from Python's complaint about arguments."""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", message)
    if unknown:
        return f"unknown key {unknown[1]!r}; remove it or correct its spelling"
    missing = re.search(r"missing \d+ required .*?argument[s]?: (.*)", message)
    if missing:
        return f"missing key {missing[1]}; add it"
    return f"{' '.join(message.split())}; correct the values"

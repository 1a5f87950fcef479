"""Reads YAML files of the user that are lists of entries."""

from collections.abc import Sequence
from pathlib import Path

import yaml

from evoros.base.errors import InputError, single_line


def _describe(error: UnicodeDecodeError | yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        return f"line {error.problem_mark.line + 1}: {error.problem}"
    return single_line(error)


def read_entries(path: Path, content: str, keys: str, begin: str) -> Sequence[object]:
    """Read the entries of a file; ``content``, ``keys`` and ``begin`` are for messages."""
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: must be a YAML file of {content} ({error.strerror}); correct the path"
        ) from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(
            f"{path}: must be a YAML file of {content} ({_describe(error)}); correct it"
        ) from error
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f'{path}: must be a list of {content}, each with {keys}; write "{begin}" for each'
        )
    return entries

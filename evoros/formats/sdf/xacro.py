"""SDF files with xacro inside."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from evoros.formats.lenient_xml import XACRO
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions, choose_instead, expand


def is_xacro(file: Path, content: bytes) -> bool:
    """Whether a file has to be expanded: by its suffix, or because it declares xacro."""
    return file.suffix == ".xacro" or XACRO.encode() in content


def expand_world(file: Path, arguments: Mapping[str, object], folders: Sequence[str]) -> bytes:
    """Return the content that a world's xacro file expands to.

    Raises:
        InputError: it cannot be expanded.
    """
    options = ReadOptions(arguments=arguments, packages=folders, packages_key="model_paths")
    text, absences = expand(file, options, index_packages(file, folders))
    absences.require_none(choose_instead(absences, options))
    return text.encode()

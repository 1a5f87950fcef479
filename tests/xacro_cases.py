"""Descriptions with xacro, for the tests of their readers."""

from pathlib import Path

XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'


def write(folder: Path, body: str, name: str = "r.xacro") -> str:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(XACRO.format(body))
    return str(path)

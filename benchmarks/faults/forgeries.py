"""Forgeries: changes of a folder that somebody may make who wants to harm its reader."""

import json
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import yaml
from helpers import everything, reseal

from evoros.storage.digests import Entry, read_entries, write_entries
from evoros.storage.layout import seal_json

Forgery = Callable[[Path, Path, Random], str]
"""Forges a folder and says how; the second folder is outside of it."""

ESCAPES = ("\x1b]0;title\x07", "\x1b[2J", "\x9b31m", "a\rb", "a\nb", "\u202etxt")
NUMBERS = ("nan", "inf", "-inf", "1e999", "-1", "9" * 400, "", "0x10", "1_000", "=1+1", "٣", " 1")
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1e308, 10**400, "", "x", [], {}, [None], {"a": 1}, [[1]], "9" * 400,
    "../../etc/passwd", *ESCAPES[:3],
)  # fmt: skip
TARGETS = {
    "os.system": ["touch MARK"],
    "subprocess.check_call": [["touch", "MARK"]],
    "builtins.exec": ["open('MARK', 'w')"],
    "pandas.read_pickle": ["MARK"],
    "hydra.utils.instantiate": [{"_target_": "os.system", "_args_": ["touch MARK"]}],
    "evoros.files.disk.make_folder": [{"_target_": "pathlib.Path", "_args_": ["MARK"]}],
    "evoros.cli.main.evoros": [["hydra.run.dir=MARK"]],
    "no.such.module": [],
    "": [],
    "..": [],
    "${seed}": [],
}
OUTSIDE = (
    "/dev/zero", "../../outside/secret", "generations/../../../../../../dev/zero", "..", ".", "",
    "generations/../config.yaml", "generations", "/etc/passwd", "a" * 5000, "x\ny", "~/x",
)  # fmt: skip


def _reseal(folder: Path) -> None:
    """Give right digests to what can still be read."""
    with suppress(ValueError, RecursionError):
        reseal(folder)


def _choose_file(folder: Path, rng: Random) -> Path:
    return folder / rng.choice(sorted(everything(folder)))


def put_link(folder: Path, outside: Path, rng: Random) -> str:
    """Put a symbolic link in the place of a file or a folder, or beside them."""
    place = rng.choice([_choose_file(folder, rng), folder / "champion", folder / "generations"])
    if rng.random() < 0.3:
        place = place.with_name(rng.choice((f".{place.name}.part", "more", f"{place.name}.bak")))
    target = rng.choice([outside / "secret", outside, Path("/dev/zero"), Path("nowhere"), place])
    if place.exists():
        place.rename(outside / "moved")
        target = rng.choice([outside / "moved", target])
    place.symlink_to(target)
    return f"{place.relative_to(folder)} leads to {target.name}"


def put_special(folder: Path, outside: Path, rng: Random) -> str:
    """Put a pipe, a device, a socket or a folder in the place of a file."""
    place = _choose_file(folder, rng)
    kind = rng.choice(("pipe", "zero", "random", "socket", "folder"))
    place.unlink()
    if kind == "socket":
        _put_socket(place)
    elif kind == "folder":
        place.mkdir()
    elif kind == "pipe" or os.geteuid():
        os.mkfifo(place)
    else:
        os.mknod(place, 0o20666, os.makedev(1, {"zero": 5, "random": 9}[kind]))
    return f"{place.relative_to(folder)} is a {kind}"


def _put_socket(place: Path) -> None:
    here = os.open(place.parent, os.O_RDONLY)  # the path of a socket is short
    try:
        with socket.socket(socket.AF_UNIX) as unix:
            unix.bind(f"/proc/self/fd/{here}/{place.name}")
    finally:
        os.close(here)


def put_sparse(folder: Path, outside: Path, rng: Random) -> str:
    """Make a file far larger than memory, of zeros that take no place on the disk."""
    place = _choose_file(folder, rng)
    os.truncate(place, 64 << 30)
    return f"{place.relative_to(folder)} has 64 GiB"


def put_hard_link(folder: Path, outside: Path, rng: Random) -> str:
    """Give a file outside a second name within."""
    place = _choose_file(folder, rng)
    (outside / "twin").write_bytes(place.read_bytes())
    place.unlink()
    place.hardlink_to(outside / "twin")
    return f"{place.relative_to(folder)} is a hard link"


def name_outside(folder: Path, outside: Path, rng: Random) -> str:
    """Let digests.csv name a file outside."""
    name = rng.choice(OUTSIDE)
    entries = dict(read_entries((folder / "digests.csv").read_bytes()).by_name)
    entries[name] = Entry(rng.choice(("0" * 64, "")), rng.choice(("", "0" * 40)))
    (folder / "digests.csv").write_text(write_entries(entries))
    return f"digests.csv names {name[:40]!r}"


def forge_field(folder: Path, outside: Path, rng: Random) -> str:
    """Give a field of a JSON file another value, and the file a right digest."""
    name = rng.choice(("manifest.json", "status.json", "setting.json", "champion/certificate.json"))
    if not (folder / name).exists():
        name = "manifest.json"
    fields = json.loads((folder / name).read_text())
    fields.pop("digest", None)
    node, keys = fields, []
    while True:
        key = rng.choice(sorted(node) if isinstance(node, dict) else range(len(node)))
        keys.append(str(key))
        if not node[key] or not isinstance(node[key], dict | list) or rng.random() < 0.3:
            break
        node = node[key]
    value = rng.choice(VALUES)
    node[key] = value
    sealed = name in ("manifest.json", "status.json")
    (folder / name).write_text(seal_json(name, fields) if sealed else json.dumps(fields))
    _reseal(folder)
    return f"{name} {'.'.join(keys)} is {str(value)[:20]!r}"


def forge_cell(folder: Path, outside: Path, rng: Random) -> str:
    """Give a cell of a table another value, and the row and the table right digests."""
    tables = [name for name in sorted(everything(folder)) if name.endswith(".csv")]
    name = rng.choice([table for table in tables if table != "digests.csv"])
    lines = (folder / name).read_text().split("\n")
    at = rng.randrange(len(lines) - 1)
    cells = lines[at].split(",")
    column = rng.randrange(len(cells))
    cells[column] = rng.choice((*NUMBERS, *ESCAPES[:3], "../../x", "x" * 200_000))
    lines[at] = ",".join(cells)
    (folder / name).write_text("\n".join(lines))
    _reseal(folder)
    return f"{name} line {at + 1} cell {column + 1} is {cells[column][:20]!r}"


def nest(folder: Path, outside: Path, rng: Random) -> str:
    """Nest a file a hundred thousand deep, or let YAML's references double."""
    name = rng.choice(("manifest.json", "status.json", "setting.json", "config.yaml"))
    text = rng.choice(("[", '{"a":', "- ")) * 100_000
    if name == "config.yaml":
        doubling = "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40))
        text = rng.choice((text, f"a0: &a0 [x]\n{doubling}"))
    (folder / name).write_text(text)
    _reseal(folder)
    return f"{name} is nested, by {text[:4]!r}"


def forge_config(folder: Path, outside: Path, rng: Random) -> str:
    """Name another class in the configuration, or give a key another value."""
    tree = yaml.safe_load((folder / "config.yaml").read_text())
    group = rng.choice([key for key in sorted(tree) if isinstance(tree[key], dict)])
    if rng.random() < 0.5:
        target = rng.choice(sorted(TARGETS))
        arguments = json.loads(json.dumps(TARGETS[target]).replace("MARK", str(outside / "mark")))
        tree[group] = {"_target_": target, "_args_": arguments}
        about = f"{group} is a {target!r}"
    else:
        value = rng.choice((*VALUES, "${oc.env:HOME}", "${nowhere}", "${seed", float("nan")))
        key = rng.choice(sorted(tree[group]) or [""])
        tree[group][key] = value
        about = f"{group}.{key} is {str(value)[:20]!r}"
    (folder / "config.yaml").write_text(yaml.safe_dump(tree))
    _reseal(folder)
    return about


def forge_text(folder: Path, outside: Path, rng: Random) -> str:
    """Write escape sequences, tags and entities into a file."""
    place = _choose_file(folder, rng)
    content = bytearray(place.read_bytes())
    at = rng.randrange(len(content) + 1)
    entity = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
    tags = ("<script>alert(1)</script>", entity, "&e;", "<include><uri>/dev/zero</uri></include>")
    text = rng.choice((*ESCAPES, *tags))
    content[at:at] = text.encode()
    place.write_bytes(content)
    if rng.random() < 0.8:
        _reseal(folder)
    return f"{place.relative_to(folder)} has {text[:20]!r}"


def forge_name(folder: Path, outside: Path, rng: Random) -> str:
    """Add a file whose name is hostile."""
    name = rng.choice((*ESCAPES, "a" * 255, "-rf", "00000.csv ", "\udcff", "é.csv"))
    folders = [folder, *(path for path in sorted(folder.rglob("*")) if path.is_dir())]
    (rng.choice(folders) / name).write_bytes(b"a,b\n1,2\n")
    return f"a file is called {name[:20]!r}"


FORGERIES: dict[str, Forgery] = {
    "link": put_link,
    "pipe, device": put_special,
    "sparse file": put_sparse,
    "hard link": put_hard_link,
    "name in digests": name_outside,
    "field": forge_field,
    "cell": forge_cell,
    "nesting": nest,
    "configuration": forge_config,
    "text": forge_text,
    "file name": forge_name,
}

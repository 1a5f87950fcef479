"""The YAML file of a design with the sensors that a robot of the user's own has already."""

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import chain, count
from typing import Any

import yaml

from evoros.config.own_files import DESIGN, OwnFile, is_bundled
from evoros.files.resources import bundled_folder
from evoros.formats.urdf.sensors import BUMPER
from evoros.robot.own_sensors import OwnSensor

SENSOR = "sensor"
AROUND = "around"
STEP_S = 0.1
"""A common multiple of the bundled simulators' steps, of which periods are multiples."""
_FIXED = "evoros.design.fixed.FixedSensor"


def plan_design(
    name: str, title: str, sensors: Sequence[OwnSensor], links: Collection[str]
) -> tuple[OwnFile | None, list[str]]:
    """Plan the file of a design with these sensors, and note all omissions and changes.

    There is none without sensors of types that evoros has. ``links`` are the robot's own.
    """
    # The link of a mounted sensor has the name of its type and a number.
    taken = {re.sub(r"_[0-9]+$", "", link) for link in links}
    taken |= set(_read_bundled(DESIGN, AROUND)["sensors"])
    types: dict[str, tuple[str, dict[str, Any]]] = {}
    fixed: dict[str, dict[str, Any]] = {}
    notes = []
    for sensor in sensors:
        kind, described = sensor.described.kind, sensor.described.name
        if not is_bundled(SENSOR, kind):
            notes.append(f"left out: sensor {described}: evoros has no {kind}")
            continue
        settings, changed = _choose_settings(kind, sensor.described.settings)
        if kind == BUMPER:
            width = _read_bundled(SENSOR, kind)["width_m"]
            changed = [
                *changed,
                f"feels a strip {width:g} m wide ahead of its link; set width_m and depth_m of its "
                f"type, and its place, in its design",
            ]
        notes += [f"sensor {described}: {text}" for text in changed]
        chosen = _name_type(described, (kind, settings), types, taken)
        types[chosen] = (kind, settings)
        fixed[_make_unique(_to_name(described), fixed)] = _place(chosen, sensor)
    if not fixed:
        return None, notes
    values = {
        "sensors": {type_name: settings for type_name, (_, settings) in types.items() if settings},
        "number": [0, 2],
        "fixed": fixed,
    }
    choices = {f"/sensor@sensors.{type_name}": kind for type_name, (kind, _) in types.items()}
    return OwnFile(DESIGN, name, title, values, {AROUND: None, **choices}), notes


def _choose_settings(kind: str, described: Mapping[str, float]) -> tuple[dict[str, Any], list[str]]:
    """Return the settings that a type of sensor has, and what had to be changed."""
    known = _read_bundled(SENSOR, kind)
    settings: dict[str, Any] = {
        key: round(value, 6) for key, value in described.items() if key in known
    }
    for key, value in described.items():
        name, _, field = key.partition(".")
        if field and name in known.get("filters", {}):
            settings.setdefault("filters", {}).setdefault(name, {})[field] = round(value, 9)
    if "period_s" not in settings:
        return settings, []
    stated = settings["period_s"]
    settings["period_s"] = round(max(1, round(stated / STEP_S)) * STEP_S, 6)
    if abs(settings["period_s"] - stated) < 1e-6:
        return settings, []
    return settings, [
        f"measures each {settings['period_s']:g} s, not each {stated:g} s; choose another multiple "
        f"of the simulator's step in its design"
    ]


def _name_type(
    described: str,
    wanted: tuple[str, dict[str, Any]],
    types: Mapping[str, object],
    taken: Collection[str],
) -> str:
    """Return the name of an equal type, or a new one: the sensor's without its number."""
    for name, known in types.items():
        if known == wanted:
            return name
    stem = re.sub(r"_*[0-9]+$", "", _to_name(described)) or wanted[0]
    stem = stem if stem not in taken else f"own_{stem}"
    return _make_unique(stem, {*taken, *types})


def _place(type_name: str, sensor: OwnSensor) -> dict[str, Any]:
    x, y, z = sensor.position_m
    place = {"x_m": x, "y_m": y, "z_m": z, "yaw_deg": sensor.yaw_deg, "pitch_deg": sensor.pitch_deg}
    told = {key: value for key, value in place.items() if value != 0.0}
    return {"_target_": _FIXED, "sensor": type_name, "link": sensor.link, **told}


def _to_name(text: str) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if name[:1].isalpha() else f"sensor_{name}".rstrip("_")


def _make_unique(name: str, taken: Collection[str]) -> str:
    names = chain([name], (f"{name}{index}" for index in count(2)))
    return next(unique for unique in names if unique not in taken)


def _read_bundled(group: str, name: str) -> dict[str, Any]:
    """Return the keys of a bundled file; those that its defaults list gives are empty."""
    path = bundled_folder("conf") / group / f"{name}.yaml"
    content: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    for entry in content.pop("defaults", []):
        for address in entry if isinstance(entry, dict) else ():
            _, _, place = address.partition("@")
            outer, _, inner = place.partition(".")
            content.setdefault(outer, {}).setdefault(inner, {})
    return content

"""Plans the YAML file of a design with the sensors found on a robot."""

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import chain, count
from typing import Any

import yaml
from hydra.utils import get_class

from evoros.base.errors import InputError
from evoros.config.own_files import DESIGN, OwnFile, is_bundled
from evoros.files.plugins import conf_folders
from evoros.formats.urdf.sensors import BUMPER
from evoros.robot.own_sensors import OwnSensor

SENSOR = "sensor"
AROUND = "around"
STEP_S = 0.1  # common multiple of bundled simulators' time steps, of which periods are multiples
_FIXED = "evoros.design.space.FixedSensor"
_MASK = "evoros.filter.mask.Mask"


def plan_design(
    name: str, title: str, sensors: Sequence[OwnSensor], links: Collection[str]
) -> tuple[OwnFile | None, list[str]]:
    """Plan the file of a design, with notes on changes; None if no sensor is supported."""
    # links of mounted sensors are named by type and number
    taken = {re.sub(r"_[0-9]+$", "", link) for link in links}
    taken |= set(_read_bundled(DESIGN, AROUND)["sensors"])
    types: dict[str, tuple[str, dict[str, Any]]] = {}
    fixed: dict[str, dict[str, Any]] = {}
    notes = []
    for sensor in sensors:
        kind, described = sensor.described.kind, sensor.described.name
        if not is_bundled(SENSOR, kind):
            notes.append(
                f"sensor {described} is left out, because evoros has no sensor type {kind}"
            )
            continue
        settings, changed = _choose_settings(kind, sensor.described.settings)
        unfit = _find_fault(kind, settings)
        if unfit:
            notes.append(f"sensor {described} ({sensor.described.place}) is left out: {unfit}")
            continue
        if kind == BUMPER:
            width = _read_bundled(SENSOR, kind)["width_m"]
            changed = [
                *changed,
                f"senses contact in a strip {width:g} m wide in front of its link; set width_m and "
                f"depth_m of the type, and the sensor's pose, in the design",
            ]
        if sensor.masked:
            changed = [*changed, _mask(settings, sensor)]
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
        f"measures every {settings['period_s']:g} s, not every {stated:g} s; to change this, "
        f"choose another multiple of the simulator's time step in the design"
    ]


def _mask(settings: dict[str, Any], lidar: OwnSensor) -> str:
    scan = settings.get("beams", _read_bundled(SENSOR, lidar.described.kind)["beams"])
    beams = [list(span) for span in lidar.masked]
    settings.setdefault("filters", {})["own_body"] = {
        "_target_": _MASK,
        "scan": scan,
        "beams": beams,
    }
    count = sum(last - first + 1 for first, last in beams)
    return (
        f"{count} of its {scan} beams see the robot itself, so the filter own_body masks these "
        "beams; mask the same beams on the real robot, or delete the filter from the design"
    )


def _find_fault(kind: str, settings: Mapping[str, Any]) -> str:
    plain = {key: value for key, value in settings.items() if key != "filters"}
    try:
        get_class(_read_bundled(SENSOR, kind)["_target_"])(**plain)
    except InputError as error:
        return str(error)
    return ""


def _name_type(
    described: str,
    wanted: tuple[str, dict[str, Any]],
    types: Mapping[str, object],
    taken: Collection[str],
) -> str:
    """Return the name of an equal type, or a new name: the sensor's, without number."""
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
    """Return the keys of a bundled file, with empty values for keys in its defaults list."""
    paths = (folder / group / f"{name}.yaml" for folder in conf_folders())
    path = next(path for path in paths if path.is_file())
    content: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    for entry in content.pop("defaults", []):
        for address in entry if isinstance(entry, dict) else ():
            _, _, place = address.partition("@")
            outer, _, inner = place.partition(".")
            content.setdefault(outer, {}).setdefault(inner, {})
    return content

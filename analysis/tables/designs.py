"""Tables of candidates, and of their sensors in the robot's frame."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import Beam, FigureContext
from evoros.storage.layout import advise_finish

from .records import Record

COLUMNS = (
    *("design", "sensor", "type", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"),
    *("fov_deg", "range_m", "pair"),
)
"""Columns of sensors with rays; mirrored twins share the number ``pair``."""
SIGNAL_COLUMNS = (*COLUMNS[:8], "measures", "width_m", "depth_m")
"""Columns of sensors without rays; the last two are the contact zone of a bumper, otherwise 0."""
TYPES = "design.sensors."  # prefix of keys of sensor types


def place_sensors(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Return the sensors with rays in the robot's frame (``COLUMNS``); angles in (-180, 180]."""
    frame = _transform_mounts(mounts, context)
    frame = frame[frame.type.isin(context.beams)].copy()
    frame["fov_deg"] = [context.beams[kind].fov_deg for kind in frame.type]
    frame["range_m"] = [context.beams[kind].range_max_m for kind in frame.type]
    return frame[list(COLUMNS)]


def place_signals(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    """Return the sensors without rays (``SIGNAL_COLUMNS``); see ``place_sensors``."""
    frame = _transform_mounts(mounts, context)
    frame = frame[frame.type.isin(context.signals)].copy()
    for name in SIGNAL_COLUMNS[-3:]:
        frame[name] = [getattr(context.signals[kind], name) for kind in frame.type]
    return frame[list(SIGNAL_COLUMNS)]


def _transform_mounts(mounts: pd.DataFrame, context: FigureContext) -> pd.DataFrame:
    frame = mounts[mounts.sensor.notna()].copy()
    frame["link"] = frame.link.astype(str)
    kinds = (*context.beams, *context.signals)
    unknown = (set(frame.link) - set(context.places)) | (set(frame.type) - set(kinds))
    if unknown:
        known = ", ".join((*context.places, *kinds))
        raise InputError(
            f"design.csv: the links or types {', '.join(map(str, unknown))} are not listed in "
            f"setting.json ({known}); restore the files"
        )
    links = np.array([context.places[link] for link in frame.link]).reshape(-1, 4)
    x, y = frame.x_m.to_numpy(float), frame.y_m.to_numpy(float)
    cos, sin = np.cos(links[:, 3]), np.sin(links[:, 3])
    frame["x_m"], frame["y_m"] = links[:, 0] + cos * x - sin * y, links[:, 1] + sin * x + cos * y
    frame["z_m"] = links[:, 2] + frame.z_m.to_numpy(float)
    yaw = frame.yaw_deg.to_numpy(float) + np.degrees(links[:, 3])
    frame["yaw_deg"] = yaw - 360.0 * np.ceil((yaw - 180.0) / 360.0)
    frame["sensor"] = frame.sensor.astype(int)
    frame["pair"] = _number_pairs(frame, context) if context.mirrored else frame.sensor
    return frame


def _number_pairs(frame: pd.DataFrame, context: FigureContext) -> "pd.Series[int]":
    """Number the pairs of each design, then its fixed sensors, which have no twins."""
    fixed = frame.type.isin([mount.sensor for mount in context.fixed])
    among = frame.groupby([frame.design, fixed]).cumcount()
    pairs = frame.design.map((~fixed).groupby(frame.design).sum() // 2)
    return (among // 2).where(~fixed, pairs + among).astype(int)


def adapt_types(context: FigureContext, evolved: Mapping[str, float]) -> FigureContext:
    """Return a context with evolved sensor types; ``evolved`` maps keys to values."""

    def find_changes(kind: str, *names: str) -> dict[str, Any]:
        keys = {name: f"{TYPES}{kind}.{name}" for name in names}
        return {name: float(evolved[key]) for name, key in keys.items() if key in evolved}

    beams = {
        kind: _adapt_beam(beam, find_changes(kind, "fov_deg", "range_min_m", "range_max_m"))
        for kind, beam in context.beams.items()
    }
    signals = {
        kind: replace(signal, **find_changes(kind, "width_m", "depth_m"))
        for kind, signal in context.signals.items()
    }
    return replace(context, beams=beams, signals=signals)


def _adapt_beam(beam: Beam, changes: dict[str, Any]) -> Beam:
    if not beam.fov_deg:  # single rays ignore the field of view
        changes.pop("fov_deg", None)
    wider = changes.get("fov_deg", beam.fov_deg) / beam.fov_deg if beam.fov_deg else 1.0
    bearings = tuple(wider * bearing for bearing in beam.bearings_deg)
    return replace(beam, bearings_deg=bearings, **changes)


def to_number(value: object) -> float:
    """Convert a number to float, and any other value to NaN."""
    return float(value) if isinstance(value, int | float) else math.nan


RANDOM = ("initial", "random", "sobol")  # operators that sample the whole space


def read_generations(record: Record) -> pd.DataFrame:
    """Read the candidates of each generation, one row each."""
    table = record.run.generations
    if table.empty:
        raise InputError(f"{record.path}: no finished generation; {advise_finish(record.path)}")
    return table


def read_best(record: Record) -> pd.DataFrame:
    """Read the row of the current best individual, the best of the last generation."""
    return select_bests(read_generations(record)).tail(1).reset_index()


def read_initial_sensors(record: Record) -> pd.DataFrame:
    """Read the sensors of the random designs in generation 0."""
    drawn = select_random(read_generations(record))
    return place_candidates(drawn.drop_duplicates("id"), record)


def select_random(generations: pd.DataFrame) -> pd.DataFrame:
    """Select the candidates of generation 0 that were sampled uniformly from the whole space."""
    return generations[(generations.generation == 0) & generations.operator.isin(RANDOM)]


def place_candidates(candidates: pd.DataFrame, record: Record) -> pd.DataFrame:
    """Place the sensors of candidates, with evolved fields of view and ranges."""
    placed = place_sensors(list_mounts(candidates, record), record.context)
    by_id = candidates.set_index("id")
    for gene, kind, column in _list_beam_genes(record):
        rows = placed.type == kind
        placed.loc[rows, column] = placed.design[rows].map(by_id[gene]).astype(float)
    return placed


def _list_beam_genes(record: Record) -> Iterator[tuple[str, str, str]]:
    columns = {"fov_deg": "fov_deg", "range_max_m": "range_m"}
    for gene, key in record.context.genes.items():
        value = re.fullmatch(rf"{re.escape(TYPES)}(.+)\.(fov_deg|range_max_m)", key)
        beam = record.context.beams.get(value[1]) if value else None
        if value and beam and (beam.fov_deg or value[2] != "fov_deg"):  # except for single rays
            yield gene, value[1], columns[value[2]]


def read_evolved(record: Record, design: int) -> dict[str, float]:
    """Read the evolved values of an individual by key, except mounts."""
    table = read_generations(record)
    row = table[table.id == design].iloc[:1]
    genes = record.context.genes
    return {key: float(row[gene].iloc[0]) for gene, key in genes.items() if len(row)}


def list_mounts(candidates: pd.DataFrame, record: Record) -> pd.DataFrame:
    """List the mounts of candidates as in ``design.csv``, including fixed sensors and twins."""
    placed = [_fix(candidates, slot, record) for slot in range(-len(record.context.fixed), 0)]
    count = sum(bool(re.fullmatch(r"sensor\d+_yaw_deg", str(name))) for name in candidates)
    slots = [_slot(candidates, slot, record) for slot in range(count)]
    if record.context.mirrored:
        slots += [mount.assign(twin=1, y_m=-mount.y_m, yaw_deg=-mount.yaw_deg) for mount in slots]
    placed += slots
    if not placed:
        return pd.DataFrame(columns=[*COLUMNS, "link"])
    mounts = pd.concat(placed, ignore_index=True)
    order = {kind: place for place, kind in enumerate(record.context.types)}
    mounts = mounts.assign(order=mounts.type.map(order))
    mounts = mounts.sort_values(["design", "order", "slot", "twin"], ignore_index=True)
    return mounts.assign(sensor=mounts.groupby("design").cumcount())


def _fix(candidates: pd.DataFrame, slot: int, record: Record) -> pd.DataFrame:
    """List one fixed sensor for each candidate; its slot number is negative."""
    mount = record.context.fixed[slot]
    values = {**asdict(mount), "type": mount.sensor, "slot": slot, "twin": 0}
    del values["sensor"]
    return pd.DataFrame({"design": candidates.id.to_numpy(), **values})


def _slot(candidates: pd.DataFrame, slot: int, record: Record) -> pd.DataFrame:
    prefix = f"sensor{slot}_"
    mounts = candidates[[name for name in candidates if str(name).startswith((prefix, "id"))]]
    mounts = mounts.rename(
        columns=lambda name: "design" if name == "id" else name.removeprefix(prefix)
    )
    mounts = mounts[mounts.x_m.notna()].assign(slot=slot, twin=0)
    areas = [record.context.regions[region] for region in mounts.region]
    mounts = mounts.assign(link=[area.link for area in areas])
    for name in ("z_m", "pitch_deg"):
        if name not in mounts:  # not evolved; constant in each region
            mounts[name] = [getattr(area, name)[0] for area in areas]
    if "type" in mounts:
        return mounts
    fixed = {mount.sensor for mount in record.context.fixed}
    return mounts.assign(type=next(kind for kind in record.context.types if kind not in fixed))


def select_bests(generations: pd.DataFrame) -> pd.DataFrame:
    """Select the best candidate of each generation; confirmed candidates rank first."""
    confirmed = generations["loss"].notna() if "loss" in generations else True
    ranked = generations.assign(confirmed=confirmed).sort_values(
        ["confirmed", "fitness"], ascending=False, kind="stable"
    )
    first = ranked.drop_duplicates("generation").drop(columns="confirmed")
    return first.set_index("generation").sort_index()


def trace_fitness(generations: pd.DataFrame) -> pd.DataFrame:
    """Trace a run by generation: both scores of the best candidate, and the mean fitness."""
    best = select_bests(generations)
    return pd.DataFrame(
        {
            "recorded": best["fitness"],
            "validated": best["validated_fitness"],
            "mean": generations.groupby("generation")["fitness"].mean(),
        }
    )


def list_individuals(generations: pd.DataFrame, axis: str = "generation") -> pd.DataFrame:
    """List a run's candidates with costs and with the ``trace_fitness`` of their generation."""
    names = {"recorded": "best_recorded", "validated": "best_validated"}
    first = dict.fromkeys(("generation", axis, "id", "operator", "fitness", "validated_fitness"))
    table = generations[list(first)]
    return table.join(trace_fitness(generations).rename(columns=names), on="generation")

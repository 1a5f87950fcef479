"""Missions of champions on fresh draws, from their runs and from evaluations."""

from collections.abc import Iterator

import pandas as pd

from evoros.base.errors import InputError
from evoros.files.nested import parse_json
from evoros.storage.verification import read_text

from .designs import select_random
from .factors import name_part
from .records import EvaluationRecord, Record
from .study import Study
from .tracks import has_failed
from .validated import Scores, identify_champion, list_differences, read_evaluations


def list_missions(study: Study) -> pd.DataFrame:
    """List the missions of champions on fresh draws, with the failures under which they evolved.

    ``kind`` is the class of the run's failure, ``source`` the origin of a mission, and ``draws``
    the key of its random draws.
    """
    evaluations = read_evaluations(study)
    frames = []
    for record in study.records:
        for source, missions in _sources(record, evaluations):
            marks = {"kind": classify_failure(record), "source": source, "run": record.name}
            failed = has_failed(missions)
            outcome = {"failed": failed, "completed": missions.completed, "draws": missions.draws}
            frames.append(pd.DataFrame({**marks, **outcome}))
    # Evaluations with the same seed share missions; each mission counts once.
    table = pd.concat(frames, ignore_index=True)
    return table.drop_duplicates(["source", "run", "draws"], ignore_index=True)


def list_random_missions(study: Study) -> pd.DataFrame:
    """List the missions of each run's random designs in generation 0, free of selection bias."""
    columns = ["kind", "run", "design", "failed", "completed"]
    frames = [pd.DataFrame(columns=columns).astype({"failed": bool, "completed": bool})]
    for record in study.records:
        drawn = set(select_random(record.run.generations).id)
        missions = record.run.missions
        first = (missions.purpose == "selection") & (missions.generation == 0)
        flown = missions[first & missions.design.isin(drawn)]
        marks = {"kind": classify_failure(record), "run": record.name, "design": flown.design}
        outcome = {"failed": has_failed(flown), "completed": flown.completed.astype(bool)}
        frames.append(pd.DataFrame({**marks, **outcome}))
    return pd.concat([frame for frame in frames if len(frame)] or frames, ignore_index=True)


def _sources(record: Record, evaluations: list[Scores]) -> Iterator[tuple[str, pd.DataFrame]]:
    missions = record.run.missions
    best = record.run.champion.design.iloc[0]
    yield (
        "validated in the run",
        missions[(missions.purpose == "validation") & (missions.design == best)],
    )
    for evaluation, designs in evaluations:
        differences = list_differences(evaluation, record)
        if all(key.startswith("simulator.") for key in differences):
            simulator = name_part("simulator", evaluation.values, evaluation.choices)
            yield f"evaluated in {simulator}", _select_champion(evaluation, designs, record)


def describe_rates(record: Record) -> dict[str, str]:
    """Describe, by world, the champion's completion rate on fresh draws, with its interval."""
    if record.run.evaluates or not record.finished:
        return {}
    path = record.run.champion_file("certificate.json")
    try:
        certificate = parse_json(read_text(path))
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error
    return {
        str(world): (
            f"fresh draws: {rate['completed']}/{rate['trials']} "
            f"[{100 * rate['low']:.0f}, {100 * rate['high']:.0f} %]"
        )
        for world, rate in certificate.get("worlds", {}).items()
        if rate["trials"]
    }


def classify_failure(record: Record) -> str:
    """Return "spatial" for a failure with damage rings, otherwise the name of the run's failure."""
    name = name_part("failure", record.values, record.choices)
    return "spatial" if record.context.rings and name != "combined" else name


def _select_champion(
    evaluation: EvaluationRecord, designs: pd.DataFrame, record: Record
) -> pd.DataFrame:
    content = identify_champion(record)
    champion = designs[[other == content for other in designs["content"]]]
    names, missions = ["source", "design"], evaluation.run.missions
    keys = pd.MultiIndex.from_frame(champion[names].astype(str))
    return missions[pd.MultiIndex.from_frame(missions[names].astype(str)).isin(keys)]

"""Scores and missions of champions on fresh draws, matched by content, as folders may move."""

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import pandas as pd

from evoros.base.errors import InputError
from evoros.files.nested import parse_json
from evoros.storage.verification import read_text

from .designs import select_random, to_number
from .factors import name_part
from .records import EvaluationRecord, Record
from .study import Study
from .tracks import has_failed, name_robots

# Keys, or prefixes of keys, that affect a design's score. The world includes the course; other
# ``design`` keys only limit which designs can evolve.
MISSION = (
    *("robot", "world", "agents", "design.sensors"),
    *("failure", "controller", "simulator", "fitness"),
)
POSE = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
CONFIRMING = "confirmation.simulator"
Content = tuple[Hashable, ...]
Value = TypeVar("Value")


def select_conditions(record: Record) -> dict[str, Any]:
    """Select the values that affect a design's score, including a confirming simulator."""
    values = apply_confirmation(record.values)
    return {
        key: value for key, value in values.items() if any(is_within(key, top) for top in MISSION)
    }


def apply_confirmation(entries: Mapping[str, Value]) -> dict[str, Value]:
    """Replace the entries of the simulator (values or choices) with the confirming simulator's."""
    confirming = {
        key.removeprefix("confirmation."): entry
        for key, entry in entries.items()
        if is_within(key, CONFIRMING)
    }
    if not confirming:
        return dict(entries)
    return {k: v for k, v in entries.items() if not is_within(k, "simulator")} | confirming


def is_within(key: str, top: str) -> bool:
    """Return True if a dotted key is ``top`` or below it."""
    return key == top or key.startswith(f"{top}.")


def find_differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """List the keys with differing values; missing values are null."""
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def list_differences(evaluation: EvaluationRecord, record: Record) -> list[str]:
    """List the keys other than genes in which the conditions of an evaluation and a run differ."""
    evolved = _read_champion_genes(record)
    differences = find_differences(select_conditions(evaluation), select_conditions(record))
    return [key for key in differences if key not in evolved]


def identify_champion(record: Record) -> Content:
    """Return the content that identifies a finished run's champion: sensors and genes."""
    return _content(record.run.champion, _read_champion_genes(record))


def _read_champion_genes(record: Record) -> dict[str, float]:
    """Read the evolved values of a finished run's champion by key, except mounts."""
    return _genes(record.run.genes)


def _read_scores(evaluation: EvaluationRecord) -> pd.DataFrame:
    """Read the content and the scores of each design in a finished evaluation."""
    names = ["source", "design"]
    mounts, genes, scores = (
        table.assign(**{name: table[name].astype(str) for name in names})
        for table in (evaluation.mounts, evaluation.genes, evaluation.run.designs)
    )
    evolved = {key: _genes(rows) for key, rows in genes.groupby(names)}
    contents = {key: _content(rows, evolved.get(key, {})) for key, rows in mounts.groupby(names)}
    keys = zip(scores["source"], scores["design"], strict=True)
    scores["content"] = pd.Series([contents[key] for key in keys], scores.index, dtype=object)
    if "fitness" not in scores:
        scores["fitness"] = scores["fitness_mean"]
    return scores[["content", *names, "fitness", "fitness_sd", "trials"]]


def _content(mounts: pd.DataFrame, genes: Mapping[str, float]) -> Content:
    placed = mounts[mounts["sensor"].notna()].assign(robot=name_robots)
    placed = placed.sort_values(["robot", "sensor"])
    poses = placed[list(POSE)].astype(float).itertuples(index=False, name=None)
    names = (placed[name].astype(str) for name in ("robot", "type", "link"))
    return tuple(zip(*names, poses, strict=True)), tuple(sorted(genes.items()))


def _genes(table: pd.DataFrame) -> dict[str, float]:
    rows = zip(name_robots(table), table["key"], table["value"], strict=True)
    return {f"agents.{robot}.{k}" if robot else str(k): float(v) for robot, k, v in rows}


BY_EVALUATION, BY_RUN, BY_NOTHING = "evaluation", "run", ""
Scores = tuple[EvaluationRecord, pd.DataFrame]  # an evaluation, and a table of its designs


def validate_champions(study: Study) -> pd.DataFrame:
    """Return the recorded and validated fitness of each finished run's champion.

    The validated fitness comes from the matching evaluation with the most trials, otherwise from
    the run itself. With a confirmation, scores are from the confirming simulator.
    """
    evaluations = read_evaluations(study)
    return study.gather(lambda record: _validate(record, evaluations))


def score_under(study: Study, name: str) -> pd.DataFrame:
    """Return each champion's score in the evaluation ``name`` with the most trials, or NaN."""
    evaluations = read_evaluations(study)
    column = f"under {name}"
    named = [table for record, table in evaluations if name in (record.name, record.treatment)]
    if not named:
        known = dict.fromkeys(record.treatment for record, _ in evaluations)
        fix = f"choose one of {', '.join(known)}" if known else "evaluate the champions first"
        raise InputError(
            f"--under: {name!r} is not the label or name of a finished evaluation; {fix}"
        )
    scores = pd.concat(named).sort_values("trials", kind="stable")
    means = dict(zip(scores["content"], scores["fitness"], strict=True))

    def score(record: Record) -> pd.DataFrame:
        record.require_finished()
        return pd.DataFrame([{column: means.get(identify_champion(record), math.nan)}])

    runs = study.gather(score)
    if runs[column].isna().all():
        raise InputError(
            f"--under {name}: the evaluation contains no champion of these runs; make one under "
            f"the same conditions with evoros evaluate designs=SWEEP ..."
        )
    return runs


def read_evaluations(study: Study) -> list[Scores]:
    """Read the scores of finished evaluations; report all other evaluations."""
    return list(study.read_each(study.evaluations, _read_scores))


def list_unused(study: Study) -> dict[str, list[str]]:
    """Map each evaluation that matches no run to its differences from the closest run."""
    unused = {}
    runs = [record for record in study.records if record.finished]
    for evaluation in study.evaluations:
        nearest = min((list_differences(evaluation, run) for run in runs), key=len, default=[])
        if nearest:
            unused[evaluation.name] = list(dict.fromkeys(key.split(".")[0] for key in nearest))
    return unused


def _validate(record: Record, evaluations: Sequence[Scores]) -> pd.DataFrame:
    record.require_finished()
    status, fresh = record.run.status, _score_freshly(record, evaluations)
    in_run = to_number(status.get("best_validated_fitness"))
    by = BY_EVALUATION if fresh else BY_NOTHING if math.isnan(in_run) else BY_RUN
    row = {
        "recorded": to_number(status.get("best_fitness")),
        "validated": fresh.get("fresh", in_run),
        "validated_by": by,
        "in_run": in_run,
        "in_run_trials": status.get("validated_trials"),
        **dict.fromkeys(("fresh", "fresh_sd", "fresh_trials"), math.nan),
        "evaluation": "",
    }
    return pd.DataFrame([row | fresh])


def _score_freshly(record: Record, evaluations: Sequence[Scores]) -> dict[str, Any]:
    content, best = identify_champion(record), dict[str, Any]()
    for evaluation, table in evaluations:
        rows = table[[other == content for other in table["content"]]]
        if rows.empty or list_differences(evaluation, record):
            continue
        fitness, sd, trials = rows.iloc[0][["fitness", "fitness_sd", "trials"]]
        if not best or trials > best["fresh_trials"]:
            best = {"fresh": float(fitness), "fresh_sd": float(sd), "fresh_trials": int(trials)}
            best["evaluation"] = evaluation.name
    return best


def list_missions(study: Study) -> pd.DataFrame:
    """List the missions of champions on fresh draws, with the failures used in evolution.

    ``kind`` is the class of the run's failure, ``source`` the origin of a mission, and ``draws``
    the key of the random draws.
    """
    evaluations = read_evaluations(study)
    frames = []
    for record in study.records:
        for source, missions in _sources(record, evaluations):
            marks = {"kind": classify_failure(record), "source": source, "run": record.name}
            failed = has_failed(missions)
            outcome = {"failed": failed, "completed": missions.completed, "draws": missions.draws}
            frames.append(pd.DataFrame({**marks, **outcome}))
    # Evaluations with the same seed share missions, so count each mission once.
    table = pd.concat(frames, ignore_index=True)
    return table.drop_duplicates(["source", "run", "draws"], ignore_index=True)


def list_random_missions(study: Study) -> pd.DataFrame:
    """List the missions of generation 0's random designs, which have no selection bias."""
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
    """Describe the champion's completion rate on fresh draws and its interval, by world."""
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
    """Return "spatial" for a failure with damage rings, otherwise the name of the failure."""
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

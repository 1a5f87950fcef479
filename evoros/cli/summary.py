"""The summary printed when a run has finished."""

import math
from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from pathlib import Path
from statistics import fmean
from typing import Any

from evoros.base.errors import count_digits, override, shell_line, write_count
from evoros.certificate.certificate import Rate
from evoros.certificate.rates import bound_rate
from evoros.config.recorded import read_recorded
from evoros.files.nested import parse_json
from evoros.mission.plan import TRIALS, find_growing
from evoros.requirement.verdict import MET, UNDECIDED
from evoros.session.work import FIGURES, PAGE
from evoros.storage import layout
from evoros.storage.doubts import list_doubts
from evoros.storage.layout import read_bytes, read_rows
from evoros.storage.verdicts import describe, name_worst, read_verdicts

IN_THE_PLANE = "evoros.simulator.planar.Planar"
FEW_TRIALS = 20  # number of validation trials below which the summary recommends more
_CONFIDENCE = 0.95
MOST_ADVISED = 100_000  # maximum number of trials suggested for an undecided requirement


def summarize(folder: Path) -> str:
    """Summarize a finished run in a few lines, from its files."""
    lines = _summarize_evaluation(folder) if layout.evaluates(folder) else _summarize_search(folder)
    return "\n".join([*(f"WARNING           {doubt}" for doubt in list_doubts(folder)), *lines])


def _summarize_search(folder: Path) -> list[str]:
    status = _read(folder / layout.STATUS)
    certificate = _read(folder / "champion" / "certificate.json")
    figures = " and figures/" * (folder / FIGURES).is_dir()
    lines = [
        f"champion          {_describe_champion(certificate)}",
        f"fitness           {_describe_fitness(certificate)}",
    ]
    if status["mean_loss"] is not None:
        lines.append(f"confirmation      {_describe_loss(status)}")
    if certificate["validated_trials"]:
        lines += _describe_certificate(certificate)
    lines += [f"control           {line}" for line in _describe_controls(folder)]
    lines += [
        f"missions          {_describe_missions(status, 'generation')}",
        *_describe_stop(folder, status["reason"]),
        f"run folder        {folder}, with champion/{figures}",
    ]
    words = ("evoros", "evaluate", override("like", str(folder)), *layout.name_parts(folder))
    trials = certificate["validated_trials"]
    if trials < FEW_TRIALS:
        lines.append(f"more trials       {shell_line(*words, f'trials={max(4 * trials, 20)}')}")
    if _read(folder / layout.MANIFEST)["simulators"] == [IN_THE_PLANE]:
        lines.append(f"check in physics  {shell_line(*words, 'trials=5', 'simulator=physics')}")
    return lines


def _summarize_evaluation(folder: Path) -> list[str]:
    lines = [
        *_describe_designs(read_rows(folder / layout.SCORES)),
        f"missions          {_describe_missions(_read(folder / layout.STATUS))}",
    ]
    if (folder / layout.WORST_CASES).is_file():
        lines += [f"worst case        {line}" for line in _describe_worst_cases(folder)]
    lines += [f"requirement       {line}" for line in _describe_verdicts(folder)]
    lines += [f"to decide         {line}" for line in _advise_trials(folder)]
    page = folder / FIGURES / f"{PAGE}.html"
    if (folder / layout.TRAJECTORIES).is_dir():
        words = ("evoros", "analyze", "mission", str(folder))
        lines.append(f"worst mission     {shell_line(*words)}")
    lines += [f"page              {page}"] * page.is_file()
    lines.append(f"folder            {folder}, with {layout.SCORES}")
    return lines


def _describe_designs(rows: Sequence[Mapping[str, str]]) -> list[str]:
    scores = [float(row["fitness_mean"]) for row in rows]
    trials = int(rows[0]["trials"])
    if len(rows) == 1:
        fitness = f"{scores[0]:.3f} in 1 trial"
        if rows[0]["fitness_sd"]:
            spread = float(rows[0]["fitness_sd"])
            digits = min(
                count_digits(4 * spread / math.sqrt(trials)), 3
            )  # width of the 95 % interval
            fitness = f"{scores[0]:.{digits}f}, the mean of {trials:,} trials (standard deviation "
            fitness += f"{spread:.{count_digits(spread)}f})"
    else:
        best = max(range(len(rows)), key=scores.__getitem__)
        fitness = (
            f"{scores[best]:.3f} for design {rows[best]['design']}, the best of {len(rows)}; mean "
            f"of all {fmean(scores):.3f}; {write_count(trials, 'trial')} each"
        )
    ending = "_completed"
    shares = {
        name.removesuffix(ending): fmean(float(row[name]) for row in rows)
        for name in rows[0]
        if name.endswith(ending) and all(row[name] for row in rows)
    }
    if len(rows) == 1:
        rates = {}
        for world, share in shares.items():
            done = round(share * trials)
            rates[world] = Rate(done, trials, *bound_rate(done, trials, _CONFIDENCE))
        completed = _write_rates(rates, _CONFIDENCE)
    else:
        completed = ", ".join(f"{world} {100 * share:.0f} %" for world, share in shares.items())
    return [f"fitness           {fitness}", *[f"completed         {completed}"] * bool(shares)]


def _describe_verdicts(folder: Path) -> list[str]:
    lines, parts = [], layout.name_parts(folder)
    for row in read_verdicts(folder):
        if row["level"]:
            lines.append(f"  {row['result']:9} {row['level']}: {describe(row)}")
            continue
        name = f"{row['requirement']} (design {row['design']})"
        lines.append(f"{row['result']:9} {name}, {row['claim']}: {describe(row)}")
        if row["result"] != MET:
            lines.append(f"  replay: {layout.replay_command(folder, name_worst(row), parts)}")
    return lines


def _advise_trials(folder: Path) -> Iterator[str]:
    rows = (row for row in read_verdicts(folder) if not row["level"])
    undecided = [row for row in rows if row["result"] == UNDECIDED]
    needed = [float(row["trials"]) + float(row["further_trials"]) for row in undecided]
    if not needed:
        return
    values = read_recorded(folder / layout.CONFIG).values
    growing = find_growing(values)
    most = MOST_ADVISED if growing == TRIALS else values["validation"]["max_trials"]
    numbers = [number for number in needed if number <= most]
    if numbers:
        yield f"{layout.resume_command(folder)} {growing}={max(numbers):.0f}"
    else:
        yield (
            f"{most} trials will probably not be enough; change the requirement's limit, or leave "
            f"the requirement undecided"
        )


def _describe_worst_cases(folder: Path) -> list[str]:
    # slow: imports pandas
    from evoros.storage.reading import read_overrides, read_worst_cases
    from evoros.worst_cases.summary import describe_worst_cases

    if (table := read_worst_cases(folder)) is None:
        return []
    return list(describe_worst_cases(table, read_overrides(folder), layout.name_parts(folder)))


def _describe_controls(folder: Path) -> Sequence[str]:
    if not (folder / layout.CONTROLS).is_dir():
        return ()
    # slow: imports pandas
    from evoros.analysis.report.summary import list_controls
    from evoros.analysis.tables.loading import load_study

    return list_controls(load_study([folder]))


def _describe_missions(status: Mapping[str, Any], unit: str = "") -> str:
    wall, simulated = status["session_wall_s"], status["session_simulated_s"]
    missions, now = status["missions"], status["session_missions"]
    text = f"{missions:,}"
    if unit:
        text += f" in {write_count(status['generations_done'], unit)}"
    if now < missions:
        text += f", {now:,} of them in this session"
    speed = f", {float(f'{simulated / wall:.2g}'):,.0f} times real time" if wall > 0 else ""
    return f"{text} ({_write_duration(simulated)} simulated in {_write_duration(wall)}{speed})"


def _describe_stop(folder: Path, reason: str) -> Iterator[str]:
    if reason:
        limits = (limit.split(maxsplit=2) for limit in reason.split(", "))
        more = [override(key.rstrip(":"), ceil(2 * float(cost))) for key, cost, _ in limits]
        command = " ".join((layout.resume_command(folder), *more))
        yield f"stopped           {reason}; to continue, type: {command}"


def _write_duration(seconds: float) -> str:
    for unit, size in (("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:,.0f} {unit}"
    return f"{seconds:.0f} s"


def _read(file: Path) -> dict[str, Any]:
    content: dict[str, Any] = parse_json(read_bytes(file))
    return content


def _describe_champion(certificate: Mapping[str, Any]) -> str:
    text, finalists = f"design {certificate['design']}", len(certificate["finalists"])
    if not finalists:
        return text
    trials = write_count(certificate["recorded_trials"], "trial")
    return f"{text}, chosen from {write_count(finalists, 'finalist')} in {trials}"


def _describe_fitness(certificate: Mapping[str, Any]) -> str:
    recorded, trials = certificate["recorded_fitness"], certificate["validated_trials"]
    if not trials:
        return f"{recorded:.3f} on the draws used for selection; validation.trials adds fresh draws"
    low, high = certificate["fitness_low"], certificate["fitness_high"]
    digits, interval, advice = 3, "", ""
    if low is not None:
        digits, advice = count_digits(high - low), _describe_precision(certificate)
        percent = f"{100 * certificate['confidence']:g} %"
        interval = f" ({percent} interval {low:.{digits}f} to {high:.{digits}f})"
    return (
        f"{certificate['validated_fitness']:.{digits}f} in "
        f"{write_count(trials, 'fresh trial')}{interval}; {recorded:.{digits}f} on the draws "
        f"used for selection{advice}"
    )


def _describe_certificate(certificate: Mapping[str, Any]) -> list[str]:
    confidence = certificate["confidence"]
    worlds = {name: Rate(**rate) for name, rate in certificate["worlds"].items()}
    lines = [f"completed         {_write_rates(worlds, confidence)}"]
    if parts := certificate.get("failed_parts"):
        rates = {name: Rate(**rate) for name, rate in parts.items()}
        lines.append(f"with failed parts {_write_rates(rates, confidence)}")
    return [*lines, f"rivals            {_describe_rivals(certificate)}"]


def _describe_precision(certificate: Mapping[str, Any]) -> str:
    precision, wanted = certificate["precision"], certificate["precision_trials"]
    half_width = (certificate["fitness_high"] - certificate["fitness_low"]) / 2
    if precision is None or half_width <= precision:
        return ""
    if wanted is None:
        return f"; precision {precision:g} cannot be reached"
    return (
        f"; precision {precision:g} was not reached; a new run with validation.max_trials={wanted} "
        f"should reach it"
    )


def _write_rates(rates: Mapping[str, Rate], confidence: float) -> str:
    done = sum(rate.completed for rate in rates.values())
    trials = sum(rate.trials for rate in rates.values())
    percent = f"{100 * confidence:g} % interval"
    ends = {
        name: f"{100 * rate.low:.0f} to {100 * rate.high:.0f} %" for name, rate in rates.items()
    }
    first = next(iter(rates.values()))
    if len(rates) > 1 and set(rates.values()) == {first}:
        (interval,) = set(ends.values())
        each = f"{first.completed} of {first.trials} in each ({percent} {interval})"
        return f"{done} of {trials} missions; {each}"
    listed = ", ".join(
        f"{name} {rate.completed}/{rate.trials} ({ends[name]})" for name, rate in rates.items()
    )
    return f"{done} of {trials} missions; {listed}; {percent}s"


def _describe_rivals(certificate: Mapping[str, Any]) -> str:
    rivals, advantage = certificate["rivals"], certificate["rival_advantage"]
    if not rivals:
        return "none tested on the same draws; to test some, set validation.rivals"
    if advantage is None:
        return f"{len(rivals)} tested on the same draws, but there is no interval for a comparison"
    better = [rival for rival in rivals if rival["low"] > certificate["fitness_high"]]
    if better:
        best = max(better, key=lambda rival: rival["low"])
        minimum = best["low"] - certificate["fitness_high"]
        advice = "set final_choice=halving to choose the champion on fresh draws"
        if certificate["finalists"]:
            advice = "raise final_choice.method.budget to choose more reliably"
        return (
            f"design {best['design']} is better by at least "
            f"{minimum:.{count_digits(minimum)}f}; {advice}"
        )
    first = max(rivals, key=lambda rival: rival["high"])
    shown = "the only rival is not" if len(rivals) == 1 else f"none of {len(rivals)} is"
    return (
        f"{shown} shown to be better; design {first['design']} may be better by up to "
        f"{advantage:.{count_digits(advantage)}f}"
    )


def _describe_loss(status: Mapping[str, Any]) -> str:
    best = "" if status["best_loss"] is None else f"{status['best_loss']:.3f} for the champion, "
    designs = write_count(status["confirmed"], "confirmed design")
    return f"fitness lower by {best}{status['mean_loss']:.3f} on average over {designs}"

"""The results that the commands print when a run or an evaluation is finished."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evoros.files.nested import parse_json
from evoros.session.figures import FIGURES, PAGE
from evoros.storage.doubts import list_doubts
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import MANIFEST, STATUS, WORST_CASES, replay_command
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

IN_THE_PLANE = "evoros.simulator.planar.Planar"


def summarize_run(folder: Path) -> str:
    """Describe a finished run in a few lines, from its own files."""
    status, certificate = _read(folder / STATUS), _read(folder / "champion" / "certificate.json")
    validated = status["best_validated_fitness"]
    lines = [
        f"best fitness      {status['best_fitness']:.3f} recorded"
        + ("" if validated is None else f", {validated:.3f} validated on fresh draws"),
        f"generations       {status['generations_done']}",
        _describe_missions(status),
        *_describe_final_choice(certificate),
        *_describe_certificate(certificate),
        f"champion          {folder / 'champion'}",
        f"run folder        {folder}",
    ]
    if (folder / FIGURES).is_dir():
        lines.insert(-1, f"figures           {folder / FIGURES}")
    if status["mean_loss"] is not None:
        lines.insert(1, _describe_loss(status))
    if _read(folder / MANIFEST)["simulators"] == [IN_THE_PLANE]:
        lines.append(f"check in physics  {physics_command(folder)}")
    lines[:0] = _warn_of_missions(folder)
    return "\n".join(lines)


def physics_command(folder: Path) -> str:
    """Return the command line that scores the champion of a run in rigid-body physics."""
    return f"evoros evaluate like={shlex.quote(str(folder))} simulator=physics trials=5"


def summarize_evaluation(folder: Path) -> str:
    """Describe a finished evaluation in a few lines, from its own files."""
    status = _read(folder / STATUS)
    lines = [
        f"fitness           {status['best_fitness']:.3f} of the best, {status['mean_fitness']:.3f} "
        f"on average",
        f"designs           {status['designs']}",
        _describe_missions(status),
        f"scores            {folder / 'designs.csv'}",
        f"folder            {folder}",
    ]
    if (folder / WORST_CASES).is_file():
        lines += [f"worst case        {line}" for line in _describe_worst_cases(folder)]
    lines += [f"requirement       {line}" for line in _describe_verdicts(folder)]
    page = folder / FIGURES / f"{PAGE}.html"
    lines += [f"page              {page}"] * page.is_file()
    lines[:0] = _warn_of_missions(folder)
    return "\n".join(lines)


def _describe_verdicts(folder: Path) -> list[str]:
    from evoros.requirement.pipeline import describe
    from evoros.requirement.verdict import MET
    from evoros.storage.verdicts import name_worst, read_verdicts

    lines = []
    for row in read_verdicts(folder):
        name = f"{row['requirement']} (design {row['design']})"
        lines.append(f"{row['result']:9} {name}: {row['claim']}; {describe(row)}")
        if row["result"] != MET:
            lines.append(f"  again: {replay_command(folder, name_worst(row))}")
    return lines


def judge_evaluation(folder: Path) -> int:
    """Return the exit status of a finished evaluation: the worst of its verdicts."""
    from evoros.requirement.verdict import UNDECIDED, VIOLATED
    from evoros.session.requirement_table import find_worst
    from evoros.storage.verdicts import read_verdicts

    return {VIOLATED: NOT_MET, UNDECIDED: NOT_DECIDED}.get(find_worst(read_verdicts(folder)), DONE)


def _describe_worst_cases(folder: Path) -> list[str]:
    # The table is read by pandas, which takes long to import.
    from evoros.storage.reading import read_overrides, read_worst_cases
    from evoros.worst_cases.summary import describe_worst_cases

    table = read_worst_cases(folder)
    return [] if table is None else list(describe_worst_cases(table, read_overrides(folder)))


def _describe_missions(status: Mapping[str, Any]) -> str:
    """Describe the number of missions and the speed of simulation."""
    wall, simulated = status["session_wall_s"], status["session_simulated_s"]
    speed = f", {simulated / wall:.0f} simulated s/s" if wall > 0 else ""
    return (
        f"missions          {status['missions']}, of which {status['session_missions']} now "
        f"({simulated:.0f} simulated s in {wall:.0f} s{speed})"
    )


def _warn_of_missions(folder: Path) -> list[str]:
    return [f"WARNING           {doubt}" for doubt in list_doubts(folder)]


def _read(file: Path) -> dict[str, Any]:
    content: dict[str, Any] = parse_json(read_bytes(file))
    return content


def _describe_final_choice(certificate: Mapping[str, Any]) -> list[str]:
    """Describe the trials of the recorded fitness, if the champion was chosen at the end."""
    finalists, trials = len(certificate["finalists"]), certificate["recorded_trials"]
    if not finalists:
        return []
    return [
        f"final choice      design {certificate['design']} of {finalists} finalists; its recorded "
        f"fitness is the mean of {trials} trials"
    ]


def _describe_certificate(certificate: Mapping[str, Any]) -> list[str]:
    """Describe the champion's fitness and success on fresh draws with intervals, and its rivals."""
    trials, percent = certificate["validated_trials"], f"{100 * certificate['confidence']:g} %"
    if not trials:
        return []
    lines = []
    if certificate["fitness_low"] is not None:
        low, high = certificate["fitness_low"], certificate["fitness_high"]
        lines.append(f"fitness, {percent:9}{low:.3f} to {high:.3f}, by {trials} fresh trials")
    lines.append(f"completed, {percent:7}{_write_rates(certificate['worlds'])}")
    if parts := certificate.get("failed_parts"):
        lines.append(f"with failed parts {_write_rates(parts)}")
    lines.append(f"a better design   {_describe_chance(certificate)}")
    return lines


def _write_rates(rates: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {rate['completed']}/{rate['trials']} ({rate['low']:.2f} to {rate['high']:.2f})"
        for name, rate in rates.items()
    )


def _describe_chance(certificate: Mapping[str, Any]) -> str:
    """Describe the chance that another design is better, and the designs that it covers."""
    chance = certificate["chance_of_better"]
    if chance is None:
        if certificate["rivals"]:
            return "not known: one trial on fresh draws is too few; see optimizer.validation_trials"
        return "not known: no other design met the same draws; see validation.rivals"
    led = sum(rival["led"] for rival in certificate["rivals"])
    others = len(certificate["rivals"]) - led
    kinds = [f"{led} that led a generation"] * (led > 0) + [f"{others} next best"] * (others > 0)
    return (
        f"chance {chance:.2f}, among {' and '.join(kinds)}, on the same draws"
        f"{_describe_better(certificate)}"
    )


def _describe_better(certificate: Mapping[str, Any]) -> str:
    """Describe the rival that scores more than the champion on all of its draws, if any."""
    champion, trials = certificate["validated_fitness"], certificate["validated_trials"]
    best = max(certificate["rivals"], key=lambda rival: rival["fitness"])
    if best["trials"] != trials or best["fitness"] <= champion:
        return ""
    more = f"; design {best['design']} scores {best['fitness'] - champion:.3f} more"
    if certificate["finalists"]:
        return f"{more}; a larger final_choice.method.budget chooses more surely"
    return f"{more}; final_choice=halving chooses the champion on fresh draws"


def _describe_loss(status: Mapping[str, Any]) -> str:
    """Describe the fitness in the run's own simulator less the confirmed fitness."""
    best = "" if status["best_loss"] is None else f"{status['best_loss']:.3f} of the best, "
    mean = f"{status['mean_loss']:.3f} on average of {status['confirmed']} designs"
    return f"loss, confirmed   {best}{mean}"

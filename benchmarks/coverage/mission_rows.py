"""Intervals, tests and verdicts of missions: shares, changes of pairs, requirements."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
from numpy.random import Generator
from rows import SLOW, Row, Subject, Trial, within

from evoros.analysis.statistics.regression import (
    bounded_change_interval,
    change_interval,
    compare_missions,
    mcnemar,
    share_change_interval,
)
from evoros.analysis.statistics.small_samples import (
    LEVEL,
    fisher,
    share_difference,
    share_interval,
)
from evoros.analysis.statistics.worst_cases import estimate_risks
from evoros.certificate.rates import bound_difference, bound_rate, share_level
from evoros.failure.protocol import Case
from evoros.requirement.bets import bound, bound_from_below, count_to_proof, decide
from evoros.requirement.requirements import Assessment
from evoros.requirement.verdict import MET, VIOLATED
from evoros.worst_cases.worst_cases import CaseTrials

SHARES = (0.5, 0.9, 0.98, 0.99)
CHANGED = (0.01, 0.05, 0.2)
CONFIDENCE = 1 - LEVEL


def _by_share(make: Callable[..., Trial], *rest: Any) -> dict[str, Trial]:
    return {f"{100 * share:g} %": make(share, *rest) for share in SHARES}


def _by_change(make: Callable[..., Trial], *rest: Any) -> dict[str, Trial]:
    return {f"{100 * share:g} % change": make(share, *rest) for share in CHANGED}


def _rate(share: float, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        low, high = bound_rate(int(rng.binomial(n, share)), n, CONFIDENCE)
        return within(low, share, high)

    return trial


def _analyzed_rate(share: float, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        interval = share_interval(int(rng.binomial(n, share)), n)
        return within(interval.low, share, interval.high)

    return trial


def _difference(share: float, m: int, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        counts = int(rng.binomial(m, share)), m, int(rng.binomial(n, share - 0.1)), n
        interval = share_difference(*counts)
        return within(interval.low, 0.1, interval.high)

    return trial


def _case_difference(share: float, m: int, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        first, second = (int(rng.binomial(m, share)), m), (int(rng.binomial(n, share - 0.1)), n)
        low, high = bound_difference(first, second, CONFIDENCE)
        return within(low, 0.1, high)

    return trial


def _fisher(share: float, m: int, n: int) -> Trial:
    def trial(rng: Generator) -> bool:
        return fisher(int(rng.binomial(m, share)), m, int(rng.binomial(n, share)), n) < LEVEL

    return trial


def _bet_bound(share: float, n: int) -> Trial:
    def trial(rng: Generator) -> bool | None:
        low, _ = bound((rng.random(n) < share).astype(float), CONFIDENCE)
        return within(low, share, 1.0)

    return trial


def _bet(share: float, wrong: str) -> Trial:
    """Whether a limit that is the truth is shown to be exceeded, or to be missed."""

    def trial(rng: Generator) -> bool:
        result, _ = decide((rng.random(500) < share).astype(float), share, CONFIDENCE)
        return result == wrong

    return trial


def _draw_changes(rng: Generator, share: float, n: int, lost: float) -> tuple[int, int]:
    """Draw how many of n missions were gained and lost, if this share of changes is a loss."""
    gained, fewer, _ = rng.multinomial(n, [share * (1 - lost), share * lost, 1 - share])
    return int(gained), int(fewer)


def _share_change(share: float, n: int, lost: float) -> Trial:
    def trial(rng: Generator) -> bool | None:
        interval = share_change_interval(*_draw_changes(rng, share, n, lost), n)
        return within(interval.low, share * (1 - 2 * lost), interval.high)

    return trial


def _progress_change(share: float, n: int) -> Trial:
    """The mean change of progress, which falls by 0.2 to 1 where it changes."""

    def trial(rng: Generator) -> bool | None:
        changes = np.where(rng.random(n) < share, -rng.uniform(0.2, 1.0, n), 0.0)
        interval = bounded_change_interval(changes)
        return within(interval.low, -0.6 * share, interval.high)

    return trial


def _draw_worlds(rng: Generator, share: float, n: int) -> pd.DataFrame:
    """Draw n trials in three worlds; in a share of them, each world is likely to change alike."""
    gained = rng.random(n) < 0.5
    changed = (rng.random(n) < share) & (rng.random((3, n)) < 0.8)
    return pd.DataFrame(
        {
            "design": "a",
            "world": np.repeat(["a", "b", "c"], n),
            "trial": np.tile(np.arange(n), 3),
            "completed_a": np.tile(~gained, 3).astype(float),
            "completed_b": np.where(changed, gained, ~gained).ravel().astype(float),
        }
    )


def _worlds_change(share: float, n: int) -> Trial:
    """Whether the interval over all worlds covers a change of 0."""

    def trial(rng: Generator) -> bool | None:
        over_all = compare_missions(_draw_worlds(rng, share, n), ["completed"]).iloc[0]
        return within(over_all["low"], 0.0, over_all["high"])

    return trial


def _worlds_differ(share: float, n: int) -> Trial:
    def trial(rng: Generator) -> bool:
        over_all = compare_missions(_draw_worlds(rng, share, n), ["completed"]).iloc[0]
        return bool(over_all["p"] < LEVEL)

    return trial


def _time_change(share: float, n: int) -> Trial:
    """The mean change of a time, which grows where it changes, and much in one case of ten."""

    def trial(rng: Generator) -> bool | None:
        slower = rng.exponential(5.0, n) + 50.0 * (rng.random(n) < 0.1)
        interval = change_interval(np.where(rng.random(n) < share, slower, 0.0))
        return within(interval.low, 10.0 * share, interval.high)

    return trial


def _survival(share: float, sensors: int, wrong: str) -> Trial:
    """Whether a limit is shown to be kept with one sensor at it, or to be missed with all at it."""
    rates = np.full(sensors, 1.0 if wrong == MET else share)
    rates[0] = share

    def trial(rng: Generator) -> bool:
        values = (rng.random((sensors, 300)) < rates[:, np.newaxis]).astype(float)
        results = [decide(of, share, CONFIDENCE, sensors)[0] for of in values]
        return set(results) == {MET} if wrong == MET else VIOLATED in results

    return trial


def _stopped(share: float, cases: int) -> Trial:
    """Whether any case at the limit is found to stop a design that always gets home without."""

    def draw(rate: float, rng: Generator) -> CaseTrials:
        done: list[Any] = [SimpleNamespace(completed=x < rate) for x in rng.random(40)]
        return CaseTrials(Case(), 0, outcomes={"a": done})

    def trial(rng: Generator) -> bool:
        nominal, level = draw(1.0, rng), share_level(CONFIDENCE, cases)
        return any(draw(share, rng).list_stopped(nominal, share, level) for _ in range(cases))

    return trial


def _mcnemar(share: float, n: int) -> Trial:
    def trial(rng: Generator) -> bool:
        return mcnemar(*_draw_changes(rng, share, n, 0.5)) < LEVEL

    return trial


def _rows(make: Callable[[float, int], Trial], sizes: Sequence[int]) -> list[Row]:
    return [Row(f"n = {n}", _by_share(make, n)) for n in sizes]


def _two(make: Callable[[float, int, int], Trial]) -> list[Row]:
    return [Row(f"n = {m}, {n}", _by_share(make, m, n)) for m, n in ((10, 10), (40, 40), (20, 100))]


MISSIONS = (
    Subject(
        "share completed, exact",
        "run, evaluate, worst cases, certificate",
        [bound_rate],
        _rows(_rate, (5, 10, 40, 200)),
    ),
    Subject(
        "share or risk, exact",
        "worst, strategies, claims",
        [share_interval, estimate_risks],
        _rows(_analyzed_rate, (10, 40)),
    ),
    Subject(
        "difference of shares, melded",
        "claims",
        [share_difference],
        _two(_difference),
    ),
    Subject(
        "difference that a case makes, melded",
        "worst cases",
        [bound_difference],
        _two(_case_difference),
    ),
    Subject(
        "shares differ, Fisher",
        "strategies, claims",
        [fisher],
        _two(_fisher),
        is_interval=False,
    ),
    Subject(
        "bound of a requirement, betting",
        "evaluate, regression --margin",
        [bound, bound_from_below],
        _rows(_bet_bound, (40, 200)),
    ),
    Subject(
        "a requirement at its limit is met",
        "evaluate, regression --margin",
        [decide, count_to_proof],
        [Row("up to 500 trials", _by_share(_bet, MET))],
        is_interval=False,
    ),
    Subject(
        "a requirement at its limit is violated",
        "evaluate, regression --margin",
        [decide, count_to_proof],
        [Row("up to 500 trials", _by_share(_bet, VIOLATED))],
        is_interval=False,
    ),
    Subject(
        "a failure of 1 of so many sensors is at the limit, the others never fail: met",
        "evaluate (survives, each)",
        [decide, Assessment],
        [Row(f"sensors: {n}", _by_share(_survival, n, MET)) for n in (1, 16)],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "failures of all sensors are at the limit: violated",
        "evaluate (survives, each)",
        [decide, Assessment],
        [Row(f"sensors: {n}", _by_share(_survival, n, VIOLATED)) for n in (1, 16)],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "a case at the limit stops a design",
        "evaluate worst_cases=search",
        [CaseTrials.list_stopped, share_level],
        [Row(f"cases: {n}; 40 trials", _by_share(_stopped, n)) for n in (1, 9)],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "change of a share, Tango",
        "regression",
        [share_change_interval],
        [
            Row(
                f"n = {n}; {100 * lost:g} % of the changes are losses",
                _by_change(_share_change, n, lost),
            )
            for n in (20, 100)
            for lost in (0.5, 1.0)
        ],
    ),
    Subject(
        "change of progress, betting",
        "regression",
        [bounded_change_interval],
        [Row(f"n = {n}", _by_change(_progress_change, n)) for n in (20, 50, 200)],
        repetitions=SLOW,
    ),
    Subject(
        "change of a share in three worlds that change alike, betting",
        "regression",
        [compare_missions],
        [Row(f"n = {n}", _by_change(_worlds_change, n)) for n in (20, 100)],
        repetitions=SLOW,
    ),
    Subject(
        "change in completion time, bootstrap",
        "regression",
        [change_interval],
        [Row(f"n = {n}", _by_change(_time_change, n)) for n in (100, 200)],
        repetitions=SLOW,
    ),
    Subject(
        "a share changes in three worlds that change alike, permuted signs",
        "regression",
        [compare_missions],
        [Row(f"n = {n}", _by_change(_worlds_differ, n)) for n in (20, 100)],
        is_interval=False,
        repetitions=SLOW,
    ),
    Subject(
        "a share changes, McNemar",
        "regression",
        [mcnemar],
        [Row(f"n = {n}", _by_change(_mcnemar, n)) for n in (20, 100)],
        is_interval=False,
    ),
)

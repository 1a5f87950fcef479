"""Simulates how often requirements with levels are wrongly decided, if one sensor is weak.

Completions are drawn at random, and each level is decided by the bets of evaluations, in rounds of
as many trials. Prints, for robots with 1 to 16 sensors, the shares of verdicts and the mean number
of trials at all levels.
"""

import argparse
from statistics import fmean

import numpy as np

from evoros.base.arrays import Array
from evoros.requirement.bets import decide
from evoros.requirement.claim import Claim
from evoros.requirement.requirements import ROUND, Requirement, Survival, list_levels
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED

WORLD = "hall"
RESULTS = (MET, VIOLATED, UNDECIDED)
SENSORS = (1, 2, 3, 4, 6, 8, 12, 16)
STUDIES: tuple[tuple[str, Requirement, int, float, tuple[float, ...]], ...] = (
    ("survives", Survival(1, times_s=(0.0,)), 1000, 0.95, (0.4, 0.6)),
    ("survives", Survival(1, times_s=(0.0,)), 300, 0.95, (0.5,)),
    ("each", Claim("completed", at_least=0.95, each="failed_sensor"), 500, 0.99, (0.9, 0.95, 0.99)),
)
"""The requirement, the trials of a level, the rate of completion, and with the weak one dead."""


def main() -> None:
    """Print a row of a table in Markdown for each requirement, weak rate and number of sensors."""
    parser = argparse.ArgumentParser(prog="levels", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, metavar="N", help="designs of a row")
    runs: int = parser.parse_args().runs
    print("| requirement | maximum | weak | sensors | met | violated | undecided | trials |")
    print("|---|---|---|---|---|---|---|---|")
    for name, requirement, most, others, rates in STUDIES:
        for weak in rates:
            for sensors in SENSORS:
                rng = np.random.default_rng([sensors, round(1000 * weak)])
                dead = [weak] + [others] * (sensors - 1)
                ends = [
                    simulate(requirement, draw_values(requirement, dead, others, most, rng))
                    for _ in range(runs)
                ]
                shares = [fmean(result == one for result, _ in ends) for one in RESULTS]
                cells = " | ".join(f"{share:.3f}" for share in shares)
                count = fmean(count for _, count in ends)
                print(
                    f"| `{name}` | {most} | {weak} | {sensors} | {cells} | {count:.0f} |",
                    flush=True,
                )


def draw_values(
    requirement: Requirement, dead: list[float], intact: float, most: int, rng: np.random.Generator
) -> Array:
    """Draw which missions are completed (levels, most): 1.0 or 0.0.

    With sensor ``i`` dead, missions are completed at the rate ``dead[i]``, and without a failure at
    ``intact``. Failures of several sensors are as bad as the worst of them.
    """
    cases = [level.condition.case for level in list_levels(requirement, [WORLD], len(dead))]
    rates = [min((dead[i] for i in case.sensors), default=intact) for case in cases if case]
    return (rng.random((len(rates), most)) < np.array(rates)[:, np.newaxis]).astype(float)


def simulate(requirement: Requirement, values: Array) -> tuple[str, int]:
    """Return the verdict on a design, and the number of trials at all levels, as an evaluation."""
    claim = requirement.claim_for(WORLD) if isinstance(requirement, Survival) else requirement
    ends = [decide(row, claim.limit, claim.confidence, len(values)) for row in values]
    results = [result for result, _ in ends]
    counts = [min(-(-count // ROUND) * ROUND, values.shape[1]) for _, count in ends]
    if isinstance(requirement, Survival) and VIOLATED in results:  # ends with the first of them
        last = min(counts[i] for i, result in enumerate(results) if result == VIOLATED)
        counts = [min(count, last) for count in counts]
    return next((one for one in (VIOLATED, UNDECIDED) if one in results), MET), sum(counts)


if __name__ == "__main__":
    main()

"""A summary of the worst cases in an evaluation, with commands that repeat them."""

from collections.abc import Iterator, Sequence

import pandas as pd

from evoros.base.errors import override, shell_line, unescape, write_count
from evoros.failure.protocol import CONFIRMED, MODEL, NOMINAL, SCREENED, Case

REPLACED = ("worst_cases", "requirements", "failure", "filter@failure", "trials", "hydra")


def describe_worst_cases(
    table: pd.DataFrame, typed: Sequence[str], option: Sequence[str]
) -> Iterator[str]:
    """Yield lines about each design, with a command that repeats the design's worst case."""
    for (source, design), rows in table.groupby(["source", "design"], sort=False):
        yield f"design {design} of {source}: {_describe_design(rows)}"
        yield f"  under the run's failure model: {_describe_model(rows)}"
        smallest = rows[rows["smallest"]]
        if len(smallest):
            case = Case.parse(str(smallest["case"].iloc[0]))
            trials = int(rows.loc[rows["stage"] == CONFIRMED, "trials"].max())
            screened = int(rows.loc[rows["stage"] == SCREENED, "trials"].max())
            again = write_command(typed, option, str(source), case, screened + trials)
            yield f"  repeat this case: {again}"


def _describe_design(table: pd.DataFrame) -> str:
    nominal = table[table["stage"] == NOMINAL].set_index("world")
    smallest, cases = table[table["smallest"]], table["number"].nunique() - 1
    if smallest.empty:
        worst = table[table["stage"] == CONFIRMED].sort_values("rate", kind="stable").head(1)
        most = int(table["failed"].max())
        text = f"not stopped by any of {cases} cases of up to {write_count(most, 'failed sensor')}"
        for row in worst.to_dict("records"):
            text += f"; the worst is {row['case']}: {_compare(row, nominal)}"
        return text
    first = smallest["number"].iloc[0]
    rows = smallest[(smallest["number"] == first) & smallest["stops"]].to_dict("records")
    failed = int(smallest["failed"].iloc[0])
    sensors = "1 failed sensor" if failed == 1 else f"{failed} failed sensors"
    others = smallest["number"].nunique() - 1
    also = f", and by {write_count(others, 'other case')} of this size" if others else ""
    compared = "; ".join(_compare(row, nominal) for row in rows)
    return f"stopped by {sensors}, {rows[0]['case']}{also} ({cases} cases tried): {compared}"


def _describe_model(table: pd.DataFrame) -> str:
    rates, trials = [], 0
    for row in table[table["stage"] == MODEL].to_dict("records"):
        lost, low, high = (100 - 100 * float(row[name]) for name in ("rate", "high", "low"))
        rates.append(f"{row['world']} {lost:.0f} % ({low:.0f} to {high:.0f})")
        trials = int(row["trials"])
    return f"share of missions not completed ({trials} per world): {', '.join(rates)}"


def _compare(row: dict[str, object] | dict[object, object], nominal: pd.DataFrame) -> str:
    other = nominal.loc[str(row["world"])]
    return (
        f"{row['world']} completed in {_write_rate(row)} of {row['trials']} trials with the "
        f"failure, {_write_rate(other.to_dict())} without it"
    )


def _write_rate(row: dict[str, object] | dict[object, object]) -> str:
    rate, low, high = (100 * float(str(row[name])) for name in ("rate", "low", "high"))
    return f"{rate:.0f} % ({low:.0f} to {high:.0f})"


def write_command(
    typed: Sequence[str], option: Sequence[str], source: str, case: Case, trials: int
) -> str:
    """Return the command line that repeats the missions of a case."""
    kept = [override for override in typed if not _is_replaced(override)]
    times = ",".join(map(repr, case.times_s))
    stated = [
        "failure=given",
        f"failure.sensors=[{','.join(map(str, case.sensors))}]",
        f"failure.time_s=[{times}]",
        f"trials={trials}",
    ]
    return shell_line(
        "evoros", "evaluate", override("designs", unescape(source)), *kept, *stated, *option
    )


def _is_replaced(override: str) -> bool:
    key = override.lstrip("+~").partition("=")[0]
    return key == "designs" or key.split(".")[0].startswith(REPLACED)

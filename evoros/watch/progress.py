"""The section of the page that tells how far the runs are, with the end of their logs."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from evoros.analysis.report.templates import Table, render
from evoros.session.overview import COLUMNS, Overview, list_cells, write_clock
from evoros.storage.layout import FINISHED, RUNNING
from evoros.watch.folders import Look

WAITING = "waiting"
WORDS = ("run", "state")
"""Columns without numbers."""


def render_progress(look: Look, trouble: str) -> Markup:
    """Render the section; ``trouble`` tells why the figures are not drawn."""
    runs = look.overviews
    heads = [(name, name not in WORDS) for name in ("run", *COLUMNS)]
    table = Table(heads, [(look.names[run.path], *list_cells(run)) for run in runs])
    return render(
        "progress.html",
        tiles=list(_list_tiles(runs, look.names)),
        share=sum(map(_share, runs)) / len(runs) if runs else None,
        table=table if len(runs) > 1 else None,
        reasons=[f"{look.names[run.path]}: {run.reason}" for run in runs if run.reason],
        empty=[str(path) for path in look.empty],
        trouble=trouble,
        log=look.log,
    )


def describe_state(runs: Sequence[Overview]) -> str:
    """Describe all runs in one word: that of the most lively."""
    states = [run.state for run in runs]
    ordered = (RUNNING, *(state for state in states if state != FINISHED), FINISHED)
    return next((state for state in ordered if state in states), WAITING)


def _share(run: Overview) -> float:
    return min(1.0, run.done / run.wanted) if run.wanted else 0.0


def _list_tiles(
    runs: Sequence[Overview], names: Mapping[Path, str]
) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and note of each number that stands alone."""
    yield "state", describe_state(runs), ""
    if not runs:
        return
    if len(runs) == 1:
        yield runs[0].units, f"{runs[0].done}", f"of {runs[0].wanted}" if runs[0].wanted else ""
    else:
        finished = [run.state for run in runs].count(FINISHED)
        yield "finished", f"{finished}", f"of {len(runs)} begun"
    best = max(runs, key=lambda run: -1e300 if run.best is None else run.best)
    if best.best is not None:
        fresh = "" if best.validated is None else f"{best.validated:.3f} validated"
        yield "best fitness", f"{best.best:.3f}", names[best.path] if len(runs) > 1 else fresh
    yield "missions", f"{sum(run.missions for run in runs):,}", ""
    speeds = [run.speed for run in runs if run.speed is not None and run.state == RUNNING]
    if speeds:
        yield "simulated s/s", f"{sum(speeds):,.0f}", ""
    left = [run.left_s for run in runs if run.left_s is not None]
    if left:
        yield "time left", write_clock(max(left)), "of running runs" if len(runs) > 1 else ""

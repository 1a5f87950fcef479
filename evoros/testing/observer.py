"""Conformance tests for observers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from evoros.observers.protocol import ObservedEnd, ObservedGeneration, ObservedRun, Observer, Value
from evoros.testing.part import DescriptionSuite

PARAMETERS: dict[str, Value] = {
    "seed": 3,
    "trials": 1.5,
    "robot.mount.z_m": -0.25,
    "draws": "per | robot, 'ä'",
    "confirmation": None,
    "design.mirrored": True,
    "worlds": "x" * 7000,
}
FILES = {"champion/design.csv": b"design,sensor\n7,0\n", "figures/fitness.pdf": b"%PDF \x00\xff"}


def example_run(name: str, origin: Path, generations: int, sweep: str | None = None) -> ObservedRun:
    """Return an unfinished run, with an id derived from its name."""
    metrics = [{"mean_fitness": i / 4, "best_fitness": i / 2} for i in range(generations)]
    recorded = tuple(
        ObservedGeneration(i, MappingProxyType(values), 1.7e9 + i)
        for i, values in enumerate(metrics)
    )
    run_id = name.encode().hex()[:32].ljust(32, "0")
    parameters = MappingProxyType(PARAMETERS)
    return ObservedRun(run_id, "example", sweep, parameters, origin, 1.7e9, recorded, None)


def end(run: ObservedRun, best: float = 2.0) -> ObservedRun:
    """Return the run in its finished state."""
    metrics = MappingProxyType({"champion.validated_fitness": best})
    return replace(run, end=ObservedEnd("finished", metrics, MappingProxyType(FILES), 1.7e9 + 99))


class ObserverSuite(DescriptionSuite):
    """Conformance tests for an observer, on synthetic runs; test classes must define ``read``."""

    part: Observer
    protocol = Observer

    def read(self, run: ObservedRun) -> Any:
        """Return all that the tracker has stored about a run, in the tracker's order.

        Runs with equal content must have equal results, so leave out ids and times of sending.
        """
        raise NotImplementedError

    def choose_origin(self, folder: Path) -> Path:
        """Return the base folder of relative paths; override to share a folder."""
        return folder

    def send(self, *steps: ObservedRun) -> Any:
        """Send the steps of a run over one connection; return what the tracker has stored."""
        with self.part.open(steps[0]) as send:
            for run in steps:
                send(run)
        return self.read(steps[-1])

    def test_what_it_needs_is_there(self) -> None:
        """The check passes in the test environment."""
        self.part.check()

    def test_live_and_later_are_the_same(self, tmp_path: Path) -> None:
        """A run sent while in progress is stored in the same way as a run sent from its folder."""
        origin = self.choose_origin(tmp_path)
        live = _grow("live", origin, 3)
        shown = self.send(*live, end(live[-1]))
        later = self.send(end(example_run("later", origin, 3)))
        assert later == shown, "a run sent at once must be stored like one sent in progress"
        assert self.read(live[-1]) == shown, "sending a run must not change another run"

    def test_sending_twice_changes_nothing(self, tmp_path: Path) -> None:
        """The tracker recognizes known records, over the same connection and over a new one."""
        run = end(example_run("twice", self.choose_origin(tmp_path), 3))
        shown = self.send(run)
        assert self.send(run, run) == shown, "sending a run again must not duplicate content"

    def test_a_part_is_completed(self, tmp_path: Path) -> None:
        """A run that was stopped or sent in part is continued, not duplicated."""
        origin = self.choose_origin(tmp_path)
        whole = self.send(end(example_run("whole", origin, 4)))
        self.send(*_grow("part", origin, 2))
        completed = self.send(end(example_run("part", origin, 4)))
        assert completed == whole, "a run sent in two parts must be stored like one sent at once"

    def test_a_finished_run_goes_on(self, tmp_path: Path) -> None:
        """An extended run has each of its generations exactly once."""
        origin = self.choose_origin(tmp_path)
        self.send(end(example_run("longer", origin, 2)))
        steps = *_grow("longer", origin, 4), end(example_run("longer", origin, 4), 3.0)
        shown = self.send(*steps)
        assert self.send(*steps) == shown, "sending an extended run again must not change it"


def _grow(name: str, origin: Path, generations: int) -> Sequence[ObservedRun]:
    return [example_run(name, origin, number) for number in range(generations + 1)]

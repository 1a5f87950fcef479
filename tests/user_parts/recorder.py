"""Observers of tests: one writes down what it gets, and one fails."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, cast

from evoros.parts import NOT_NEGATIVE, TEXT, ObservedRun, Observer, Send, checked


@dataclass(frozen=True)
@checked
class Recorder(Observer):
    """Appends a line to a file whenever it gets a run."""

    file: Annotated[str, TEXT] = "sent.jsonl"

    def check(self) -> None:
        """Need nothing."""

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        with (run.origin / self.file).open("a") as file:

            def send(run: ObservedRun) -> None:
                line = {
                    "id": run.id,
                    "name": run.name,
                    "group": run.group,
                    "generations": [generation.number for generation in run.generations],
                    "metrics": [dict(generation.metrics) for generation in run.generations],
                    "parameters": dict(run.parameters),
                    "state": run.end and run.end.state,
                    "champion": dict(run.end.metrics) if run.end else {},
                    "files": sorted(run.end.files) if run.end else [],
                }
                file.write(json.dumps(line) + "\n")

            yield send


@dataclass(frozen=True)
@checked
class Failing(Observer):
    """Fails from some generation on, or when it is opened."""

    text: str = "no answer"
    generation: Annotated[int, NOT_NEGATIVE] = 0

    def check(self) -> None:
        """Need nothing."""

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        def send(run: ObservedRun) -> None:
            if len(run.generations) >= self.generation:
                raise ConnectionError(self.text)

        yield send
        raise ConnectionError("not closed either")


@dataclass(frozen=True)
class Meddler(Observer):
    """Tries to change what it gets; an observer whose attempt succeeds writes ``changed``."""

    def check(self) -> None:
        """Need nothing."""

    @contextmanager
    def open(self, run: ObservedRun) -> Iterator[Send]:
        def send(run: ObservedRun) -> None:
            for mapping in (run.parameters, *(g.metrics for g in run.generations)):
                try:
                    cast(Any, mapping)["seed"] = 7
                except TypeError:
                    continue
                (run.origin / "changed").touch()
            try:
                cast(Any, run).name = "another"
            except AttributeError:
                return
            (run.origin / "changed").touch()

        yield send

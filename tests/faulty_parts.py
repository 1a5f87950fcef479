"""Right parts, and the same parts with one fault each."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from evoros.optimizer.random_search import RandomSearch
from evoros.parts import (
    PROBABILITY,
    Allocation,
    Array,
    Briefing,
    Channels,
    Failure,
    Fault,
    Filter,
    Fitness,
    Generator,
    Goals,
    Individual,
    Layer,
    LiveController,
    Optimizer,
    Outcome,
    Robot,
    Search,
    Silence,
    Space,
    Standing,
    checked,
)
from evoros.testing.part import LATER_S

SEEN: list[float] = []


class Parameters(NamedTuple):
    probability: float
    onset: Array
    high: Array


@dataclass(frozen=True)
@checked
class Dazzle(Filter):
    """A right filter."""

    name = "Dazzle"
    probability: Annotated[float, PROBABILITY] = 0.2

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return Parameters(self.probability, onset, channels.high)

    @staticmethod
    def rule(parameters: Any, rng: Any, values: Any, time: float) -> None:
        for i in range(len(values)):
            lost = rng.random() < parameters.probability
            if lost and time >= parameters.onset[i] and not math.isnan(values[i]):
                values[i] = parameters.high[i]


class Remembers(Dazzle):
    """Each start sees how many there were."""

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        SEEN.append(0.0)
        return Parameters((0.1 * len(SEEN)) % 1.0, onset, channels.high)


class ByTheClock(Dazzle):
    """Takes a number from the date, which a shift of the clock by ``LATER_S`` changes."""

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        share = float(datetime.now().timestamp() // LATER_S % 2)
        return Parameters(share, onset, channels.high)


class BySeconds(Dazzle):
    """Takes a number from the seconds since 1970."""

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        share = float(time.time() // LATER_S % 2)
        return Parameters(share, onset, channels.high)


class ByGlobalLuck(Dazzle):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return Parameters(float(np.random.random()), onset, channels.high)


class ChangesOnset(Dazzle):
    """Adds to the argument that it is lent."""

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        onset += 0.1
        return Parameters(self.probability, onset, channels.high)


class Early(Dazzle):
    """Acts before its onset."""

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return Parameters(self.probability, 0.5 * onset, channels.high)


class Shifts(Dazzle):
    """Draws only for channels on which it acts."""

    @staticmethod
    def rule(parameters: Parameters, rng: Generator, values: Array, time: float) -> None:
        for i in range(len(values)):
            if time >= parameters.onset[i] and not math.isnan(values[i]):
                values[i] += rng.random()


class Allocates(Dazzle):
    @staticmethod
    def rule(  # type: ignore[override]
        parameters: Parameters, values: Array, time: float
    ) -> None:
        copy = values.copy()
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = 0.5 * copy[i]


class DiffersCompiled(Dazzle):
    """Counts beyond 64 bits, which machine code does not."""

    @staticmethod
    def rule(  # type: ignore[override]
        parameters: Parameters, values: Array, time: float
    ) -> None:
        power = 3
        for _ in range(60):
            power *= 3
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] += float(power)


class Raises(Dazzle):
    """Cannot be compiled."""

    @staticmethod
    def rule(  # type: ignore[override]
        parameters: Parameters, values: Array, time: float
    ) -> None:
        if time < 0.0:
            raise ValueError("time")


class FillsSilence(Dazzle):
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return Parameters(1.0, onset, channels.high)

    @staticmethod
    def rule(  # type: ignore[override]
        parameters: Parameters, values: Array, time: float
    ) -> None:
        for i in range(len(values)):
            if time >= parameters.onset[i]:
                values[i] = parameters.high[i]


@dataclass(frozen=True)
class Unchecked(Dazzle):
    """Accepts any value of its field."""

    gain: float = 1.0


@dataclass(frozen=True)
class RaisesValueError(Dazzle):
    """Compares before it checks."""

    gain: float = 1.0

    def __post_init__(self) -> None:
        if not self.gain > 0:
            raise ValueError("gain\nmust be positive")


class Anonymous(Dazzle):
    effect = "breaks"


@dataclass
class Thawed(Filter):
    """A filter that can be changed."""

    name = "Thawed"
    rule = staticmethod(Dazzle.rule)

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        return Parameters(0.2, onset, channels.high)


@dataclass(frozen=True)
class Keeps(Dazzle):
    """Writes to a list in its fields."""

    kept: list[float] = field(default_factory=list)

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Parameters:
        self.kept.append(1.0)
        return Parameters(self.probability, onset, channels.high)


@dataclass(frozen=True)
class HoldsFunction(Dazzle):
    """Cannot be sent to a worker."""

    function: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Front(Failure):
    """A right failure model: the first sensor fails."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        onset = np.full(channels.size, math.inf)
        onset[:1] = rng.uniform(0.0, 10.0)
        return (Fault(Silence(), onset),) if channels.size else ()


class ShortOnset(Front):
    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return (Fault(Silence(), np.zeros(1)),) if channels.size else ()


class NanOnset(Front):
    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return (Fault(Silence(), np.full(channels.size, math.nan)),) if channels.size else ()


@dataclass(frozen=True)
class Careful(Fitness):
    """A right fitness."""

    def score(self, outcomes: Sequence[Outcome]) -> float:
        return sum(outcome.progress for outcome in outcomes)

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return 0.0


class NanScore(Careful):
    def score(self, outcomes: Sequence[Outcome]) -> float:
        return min(outcome.least_clearance_m for outcome in outcomes)


class RewardsLoss(Careful):
    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return sum(outcome.progress for outcome in outcomes)


class Sorts(Careful):
    """Changes the list that it is lent."""

    def score(self, outcomes: Sequence[Outcome]) -> float:
        outcomes.sort(key=lambda outcome: outcome.progress)  # type: ignore[attr-defined]
        return outcomes[0].progress


@dataclass(frozen=True)
class Blind(Layer):
    """A right layer, which never decides."""

    mode = "avoiding"

    def start(self, robot: Robot, period: float, rng: Generator) -> None:
        return None

    @staticmethod
    def rule(readings: Array, command: Array) -> bool:
        return False


class CommandsNan(Blind):
    """Follows a reading that may be silent."""

    @staticmethod
    def rule(readings: Array, command: Array) -> bool:
        command[0] = readings[0]
        return True


class ChangesReadings(Blind):
    @staticmethod
    def rule(readings: Array, command: Array) -> bool:
        readings[0] = 0.0
        return False


class Pilot:
    """Drives ahead, wherever it is."""

    mode, speed = 1, 0.3

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        command[:] = self.speed, 0.0
        return self.mode


@dataclass(frozen=True)
class Ahead(LiveController):
    """A right live controller, though in this process."""

    modes: Sequence[str] = ("navigating",)
    pilot: ClassVar[type[Pilot]] = Pilot
    period_s = 0.1

    @contextmanager
    def launch(self, briefing: Briefing) -> Iterator[Pilot]:
        yield self.pilot()


class AnswersNan(Ahead):
    class pilot(Pilot):  # noqa: N801 - in the place of a field
        speed = math.nan


class UnknownMode(Ahead):
    class pilot(Pilot):  # noqa: N801
        mode = 2


class ZeroesReadings(Ahead):
    class pilot(Pilot):  # noqa: N801
        def exchange(
            self, time: float, state: Array, leg: Array, readings: Array, command: Array
        ) -> int:
            readings[:] = 0.0
            return 1


class LostFile(Ahead):
    files = ("/nowhere/avoid.py",)


@dataclass(frozen=True)
class WithoutModes(Ahead):
    modes: Sequence[str] = ()


class Reaching:
    """Searches at random, and stretches the genomes."""

    def __init__(self, search: Search, reach: float) -> None:
        self.search, self.reach = search, reach
        self.tell, self.champions = search.tell, search.champions

    def ask(self) -> list[Individual]:
        return [replace(one, genome=self.reach * one.genome) for one in self.search.ask()]


@dataclass(frozen=True)
class BeyondTheCube(Optimizer):
    generations = 3
    validation_trials = 0

    def start(self, space: Space, goals: Goals, rng: Generator) -> Reaching:
        return Reaching(RandomSearch().start(space, goals, rng), 2.0)


class AlwaysTheSame(BeyondTheCube):
    def start(self, space: Space, goals: Goals, rng: Generator) -> Reaching:
        return Reaching(RandomSearch().start(space, goals, np.random.default_rng(0)), 1.0)


@dataclass(frozen=True)
class Mean(Allocation):
    """Gives one trial to all but the first design."""

    def most_trials(self, trials: int) -> int:
        return trials

    def next_round(self, standings: Sequence[Standing], trials: int) -> dict[int, int]:
        new = [standing for standing in standings if standing.new and not standing.scores]
        return {standing.id: 1 if rank else trials for rank, standing in enumerate(new)}

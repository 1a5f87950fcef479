"""Calls for workers: several short missions, one long mission, or a batch on a device."""

import pickle
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter, process_time
from typing import TYPE_CHECKING, NamedTuple

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.executor.protocol import KEPT, Batches, Shared
from evoros.mission.mission import Mission, Outcomes
from evoros.mission.rollout import Rollout, run_mission
from evoros.mission.scenario import Scenario

if TYPE_CHECKING:
    from evoros.mission.batch import Batcher


CallResult = tuple[Outcomes, Array | None]  # outcomes, and trajectory if requested


class CallAnswer(NamedTuple):
    """A call's results, and the time [s] of its last ``timed`` missions, after code was loaded."""

    results: list[CallResult]
    timed: int = 0
    seconds: float = 0.0
    note: str = ""  # message that is logged once
    processor_s: float = 0.0  # processor time [s] of the call


# Time after which a worker returns a call's remaining missions. A call takes little longer than its
# last mission, so calls and missions can have the same time limit.
CALL_S = 0.1
CALLS_PER_S = 250  # maximum rate of calls in the main process; with many workers, calls are longer
FIRST = 1  # number of missions in a call before the first timing
GROWTH = 8  # maximum ratio of a call's missions to the missions finished in any earlier call
MEMORY = 0.9  # weight of a call relative to the next one in the running average


@lru_cache(maxsize=KEPT)
def pack(scenario: Scenario) -> Shared:
    """Pickle a scenario once for all missions; raise an InputError on failure."""
    try:
        content = pickle.dumps(scenario)
    except Exception as error:  # a user's class may raise any exception
        raise InputError(
            f"the experiment cannot be sent to worker processes ({error}); define every class at "
            "the top level of a module, and keep open files and similar objects out of parts"
        ) from error
    return Shared.of(zlib.compress(content, 1))


@lru_cache(maxsize=KEPT)
def unpack(packed: Shared) -> Scenario:
    """Unpickle a scenario once per worker process."""
    scenario: Scenario = pickle.loads(zlib.decompress(packed.content))
    return scenario


def call_time(workers: int) -> float:
    """Return the time [s] after which a worker starts no more missions of a call."""
    return max(CALL_S, workers / CALLS_PER_S)


def run_for_outcomes(
    packed: Shared, missions: Sequence[Mission], seconds: float, keep: bool
) -> CallAnswer:
    """Run missions in order for at most ``seconds``; return the outcomes of those finished."""
    known = unpack.cache_info().misses
    scenario, begun, processor = unpack(packed), perf_counter(), process_time()
    end, first = begun + seconds, 0
    results: list[CallResult] = []
    for mission in missions:
        if results and perf_counter() > end:
            break
        outcomes, trajectory = run_mission(scenario, mission)
        results.append((outcomes, trajectory if keep else None))
        if unpack.cache_info().misses > known and len(results) == 1:
            begun, first = perf_counter(), 1
    seconds = perf_counter() - begun
    return CallAnswer(results, len(results) - first, seconds, "", process_time() - processor)


def run_for_trajectory(packed: Shared, mission: Mission) -> Array:
    """Run a mission and return its trajectory."""
    return run_mission(unpack(packed), mission)[1]


@dataclass
class Pace:
    """The running average of a scenario's mission times; newer calls have more weight."""

    missions: float = 0.0
    seconds: float = 0.0
    most: int = 0  # maximum number of missions finished in one call

    def note(self, finished: int, timed: int, seconds: float) -> None:
        """Add a call with ``finished`` missions, of which ``timed`` took ``seconds``."""
        self.missions = MEMORY * self.missions + timed
        self.seconds = MEMORY * self.seconds + seconds
        self.most = max(self.most, finished)

    def expect(self, missions: int) -> float:
        """Return the expected time [s] of ``missions``; 0 before the first timing."""
        return missions * self.seconds / self.missions if self.missions else 0.0

    def fit(self, seconds: float) -> int:
        """Return the number of missions that a worker can start in a call of ``seconds``."""
        if not self.missions:
            return FIRST
        most = max(FIRST, GROWTH * self.most)
        return 1 + int(min(most - 1, seconds * self.missions / max(self.seconds, 1e-9)))


BATCH_S = 10.0  # approximate maximum time of a batch call


class Asked(NamedTuple):
    """One run's part of a call: missions, and arguments of ``run_for_outcomes``."""

    missions: Sequence[Mission]
    seconds: float
    keep: bool


# Reasons why missions run one by one in this process, by device or scenario digest.
_notes: dict[str | bytes, str] = {}
_batchers: "dict[str, Batcher]" = {}  # batchers of open devices by device name


def _open_batcher(batches: Batches) -> "Batcher":
    from evoros.mission.batch import Batcher  # imported here, because LLVM is slow to import

    if batches.device not in _batchers:
        _batchers[batches.device] = Batcher(batches.open_device())
    return _batchers[batches.device]


def find_share(pace: Pace, missions: int, batches: Batches) -> float:
    """Return the fraction of a call that missions fill, by number or time, whichever is larger."""
    return max(missions / batches.missions, pace.expect(missions) / BATCH_S)


def run_batches(batches: Batches, asked: Sequence[Asked], *packed: Shared) -> list[CallAnswer]:
    """Run the missions of several runs together, and return an answer for each run.

    Missions that cannot be simulated together run one by one, and the answer says why. A
    RunStopped reports a broken device.
    """
    begun = perf_counter()
    pairs = enumerate(zip(packed, (part.missions for part in asked), strict=True))
    able = {i: pair for i, pair in pairs if pair[0].digest not in _notes}
    together = _run_together(batches, able)
    each = (perf_counter() - begun) / max(1, sum(map(len, together.values())))
    answers = []
    for i, (part, own) in enumerate(zip(asked, packed, strict=True)):
        if i in together:
            results = [(done, track if part.keep else None) for done, track in together[i]]
            answers.append(CallAnswer(results, len(results), each * len(results)))
        else:
            note = _notes.get(batches.device) or _notes[own.digest]
            answers.append(run_for_outcomes(own, *part)._replace(note=note))
    return answers


def _run_together(
    batches: Batches, asked: Mapping[int, tuple[Shared, Sequence[Mission]]]
) -> dict[int, list[Rollout]]:
    from evoros.compilation.device import DeviceError
    from evoros.mission.batch import NoKernel

    if batches.device in _notes or not asked:
        return {}
    groups = [(unpack(packed), missions) for packed, missions in asked.values()]
    try:
        answers = _open_batcher(batches).run(groups)
    except DeviceError as error:
        _notes[batches.device] = batches.give_up(str(error))
        return {}
    together = {}
    for i, answer in zip(asked, answers, strict=True):
        if isinstance(answer, NoKernel):
            note = f"{batches.option}: missions run one after another, because {answer}"
            _notes[asked[i][0].digest] = note
        else:
            together[i] = answer
    return together

"""The call by which a worker runs missions of one or more runs together on its device."""

from collections.abc import Mapping, Sequence
from functools import cache
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

from evoros.base.errors import RunStopped
from evoros.dispatch.calls import CallAnswer, Pace, run_for_outcomes, unpack
from evoros.executor.gpu import GPU, STOP, explain_fallback, explain_stop
from evoros.executor.payload import Shared
from evoros.executor.protocol import Batches
from evoros.mission.mission import Mission
from evoros.mission.rollout import Rollout

if TYPE_CHECKING:
    from evoros.mission.batch import Batcher

BATCH_S = 10.0
"""A call has at most as many missions as take about this time [s]."""


class Asked(NamedTuple):
    """The missions that one run adds to a call; the rest is as in ``run_for_outcomes``."""

    missions: Sequence[Mission]
    seconds: float
    keep: bool


_notes: dict[str | bytes, str] = {}
"""Why missions run one after another in this process, by the device or the scenario's digest."""


@cache
def _open_batcher(device: str) -> "Batcher":
    """Open a device, once in each worker process.

    Raises:
        DeviceError: it cannot be used.
    """
    from evoros.compilation.cuda import Cuda, import_driver  # LLVM takes long to import
    from evoros.compilation.device import Host
    from evoros.mission.batch import Batcher

    return Batcher(Cuda(import_driver()) if device == GPU else Host())


def find_share(pace: Pace, missions: int, batches: Batches) -> float:
    """Return which share of a call so many missions take, by their number or their time."""
    return max(missions / batches.missions, pace.expect(missions) / BATCH_S)


def run_batches(batches: Batches, asked: Sequence[Asked], *packed: Shared) -> list[CallAnswer]:
    """Run the missions of several runs together, and return the answer to each run.

    Missions that cannot run so run as ``run_for_outcomes`` does, and the answer notes why.

    Raises:
        PilotLost: a mission lost its pilot.
        RunStopped: the device cannot be used, and the runs shall stop then.
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
    """Run the missions that can; note why others cannot."""
    from evoros.compilation.device import DeviceError
    from evoros.mission.batch import NoKernel

    if batches.device in _notes or not asked:
        return {}
    groups = [(unpack(packed), missions) for packed, missions in asked.values()]
    try:
        answers = _open_batcher(batches.device).run(groups)
    except DeviceError as error:
        if batches.fallback == STOP:
            raise RunStopped(explain_stop(str(error))) from error
        _notes[batches.device] = explain_fallback(str(error))
        return {}
    together = {}
    for i, answer in zip(asked, answers, strict=True):
        if isinstance(answer, NoKernel):
            note = f"executor=gpu: missions run one after another, because {answer}"
            _notes[asked[i][0].digest] = note
        else:
            together[i] = answer
    return together

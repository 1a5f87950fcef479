"""The call by which a worker runs missions together on its device."""

from collections.abc import Sequence
from functools import cache
from time import perf_counter
from typing import TYPE_CHECKING

from evoros.base.errors import RunStopped
from evoros.dispatch.calls import CallAnswer, CallResult, run_for_outcomes, unpack
from evoros.executor.gpu import GPU, STOP, explain_fallback, explain_stop
from evoros.executor.payload import Shared
from evoros.executor.protocol import Batches
from evoros.mission.mission import Mission

if TYPE_CHECKING:
    from evoros.mission.batch import Batcher

BATCH_S = 10.0
"""A call has at most as many missions as take about this time [s]."""

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


def run_batch_for_outcomes(
    packed: Shared, missions: Sequence[Mission], batches: Batches, seconds: float, keep: bool
) -> CallAnswer:
    """Run missions together; else run them as ``run_for_outcomes`` does, and note why.

    Raises:
        PilotLost: a mission lost its pilot.
        RunStopped: the device cannot be used, and the run shall stop then.
    """
    from evoros.compilation.device import DeviceError
    from evoros.mission.batch import NoKernel

    begun = perf_counter()
    note = _notes.get(batches.device) or _notes.get(packed.digest)
    if note is None:
        try:
            rollouts = _open_batcher(batches.device).run(unpack(packed), missions)
        except NoKernel as error:
            note = f"executor=gpu: missions run one after another, because {error}"
            _notes[packed.digest] = note
        except DeviceError as error:
            if batches.fallback == STOP:
                raise RunStopped(explain_stop(str(error))) from error
            note = _notes[batches.device] = explain_fallback(str(error))
        else:
            results: list[CallResult] = [
                (done, track if keep else None) for done, track in rollouts
            ]
            return CallAnswer(results, len(results), perf_counter() - begun)
    return run_for_outcomes(packed, missions, seconds, keep)._replace(note=note)

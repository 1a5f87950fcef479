"""Runs missions together, in one launch of a kernel on a device."""

from collections.abc import Iterator, Sequence
from typing import Any

from numpy.random import PCG64

from evoros.base.errors import EvorosError
from evoros.compilation.device import Device, DeviceFull
from evoros.compilation.kernel import make_kernel
from evoros.compilation.machine_code import Lowered
from evoros.compilation.named_rules import name_rule
from evoros.compilation.numbered_rules import RULES
from evoros.compilation.rules import NotCompilable, try_compile
from evoros.mission.inputs import Loop, LoopCall, LoopInputs, LoopResult
from evoros.mission.kernel_loop import ROW_SIZE, lower_loop
from evoros.mission.memory_image import Image
from evoros.mission.mission import Mission
from evoros.mission.rollout import Rollout, finish, roll_out
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import RuleSimulator

Named = tuple[str, Any]
"""A kind of rules and a rule."""


class NoKernel(EvorosError):
    """Why a kernel cannot run missions, in one line; they run alone."""


class Batcher:
    """Runs missions on a device. Its kernel has all rules of the missions so far."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._numbers: dict[Any, int] = {}
        self._rules: dict[Named, Lowered] = {}
        self._kernel: Any = None

    def run(self, scenario: Scenario, missions: Sequence[Mission]) -> list[Rollout]:
        """Run missions and return what ``run_mission`` returns of each, in order.

        Raises:
            NoKernel: a rule has no code for kernels.
            DeviceError: the device cannot be used.
            InputError: see ``run_mission``.
        """
        if scenario.is_live or not isinstance(scenario.simulator, RuleSimulator):
            raise NoKernel("their simulator or a controller is not compiled")
        seats = [_Seat() for _ in missions]
        rollouts = [
            roll_out(scenario, mission, seat.prepare)
            for mission, seat in zip(missions, seats, strict=True)
        ]
        results: dict[int, Rollout] = {}
        calls: dict[int, LoopCall] = {}
        try:
            for i, rollout in enumerate(rollouts):
                try:
                    calls[i] = next(rollout).call
                except StopIteration as end:  # it could not be opened
                    results[i] = end.value
            for i, result in zip(calls, self._launch(list(calls.values())), strict=True):
                seats[i].result = result
            results |= {i: finish(rollouts[i]) for i in calls}
        finally:
            for rollout in rollouts:
                rollout.close()
        return [results[i] for i in range(len(missions))]

    def _launch(self, calls: Sequence[LoopCall]) -> list[LoopResult]:
        """Run the loops of missions."""
        if not calls:
            return []
        self._learn({rule for call in calls for rule in _list_rules(call.inputs)})
        image = Image(calls, self._numbers)
        try:
            with self._device.allocate(image.size) as memory:
                image.write(memory)
                rows = memory.address + image.rows
                self._device.launch(self._kernel, rows, ROW_SIZE, len(calls))
                return image.read(memory)
        except DeviceFull:
            if len(calls) == 1:
                raise
        half = len(calls) // 2
        return [*self._launch(calls[:half]), *self._launch(calls[half:])]

    def _learn(self, rules: set[Named]) -> None:
        """Make a kernel that has these rules, too.

        Raises:
            NoKernel: one of them has no code for kernels.
        """
        new = sorted(rules - self._rules.keys(), key=lambda rule: (rule[0], name_rule(rule[1])))
        if not new:
            return
        known, numbers = dict(self._rules), dict(self._numbers)
        for kind, rule in new:
            compiled = try_compile(rule, RULES[kind].signature)
            if isinstance(compiled, NotCompilable):
                raise NoKernel(f"{name_rule(rule)} is not compiled: {compiled}")
            if not compiled.borrows:
                raise NoKernel(f"{name_rule(rule)} makes arrays or other objects")
            known[kind, rule] = compiled.lower()
            numbers.setdefault(rule, len(numbers))
        parts: dict[str, dict[int, Lowered]] = {kind: {} for kind in RULES}
        for (kind, rule), lowered in known.items():
            parts[kind][numbers[rule]] = lowered
        code = make_kernel(self._device.target, lower_loop(), parts)
        if isinstance(code, NotCompilable):
            raise NoKernel(str(code))
        self._kernel = self._device.load(code)
        self._rules, self._numbers = known, numbers


class _Seat:
    """The result of a mission's loop, which comes from the launch."""

    result: LoopResult

    def prepare(self, inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
        """Return a loop that has run already."""
        return (lambda *call: self.result), inputs


def _list_rules(inputs: LoopInputs) -> Iterator[Named]:
    """Yield the rules of a mission.

    Raises:
        NoKernel: a random generator is of another kind than those of missions.
    """
    yield from zip(("observe", "sense", "advance"), inputs[:3], strict=True)
    for stage in (*inputs.filters, *inputs.localization, *inputs.actuation):
        if type(stage.rng.bit_generator) is not PCG64:
            raise NoKernel(f"{name_rule(stage.rule)} does not draw by PCG64")
        yield "filter", stage.rule
    for layer in inputs.layers:
        yield "layer", layer.rule

"""Runs missions of one or more scenarios together, in one launch of a kernel on a device."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, suppress
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

    def run(
        self, asked: Sequence[tuple[Scenario, Sequence[Mission]]]
    ) -> list[list[Rollout] | NoKernel]:
        """Run missions of scenarios in one launch; return what ``run_mission`` does of each.

        A scenario with a rule that has no code for kernels gets the reason.

        Raises:
            DeviceError: the device cannot be used.
            InputError: see ``run_mission``.
        """
        with ExitStack() as stack:
            groups = self._prepare([_open(*pair, stack) for pair in asked])
            calls = [call for group in groups if isinstance(group, _Group) for call in group.calls]
            results = iter(self._launch(calls))
            return [g.finish(results) if isinstance(g, _Group) else g for g in groups]

    def _prepare(self, groups: Sequence["_Group | NoKernel"]) -> list["_Group | NoKernel"]:
        """Learn the rules of groups, by one kernel if possible; put a reason for one without."""
        prepared: list[_Group | NoKernel] = list(groups)
        opened = {i: group for i, group in enumerate(groups) if isinstance(group, _Group)}
        with suppress(NoKernel):
            self._learn({rule for group in opened.values() for rule in group.list_rules()})
            return prepared
        for i, group in opened.items():
            try:
                self._learn(set(group.list_rules()))
            except NoKernel as reason:
                prepared[i] = reason
        return prepared

    def _launch(self, calls: Sequence[LoopCall]) -> list[LoopResult]:
        """Run the loops of missions."""
        if not calls:
            return []
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


class _Group:
    """The missions of a scenario, which are open during a launch."""

    def __init__(self, scenario: Scenario, missions: Sequence[Mission]) -> None:
        self._seats = [_Seat() for _ in missions]
        self._rollouts = [
            roll_out(scenario, mission, seat.prepare)
            for mission, seat in zip(missions, self._seats, strict=True)
        ]
        self._calls: dict[int, LoopCall] = {}
        self._results: dict[int, Rollout] = {}  # of missions that could not be opened

    def open(self) -> None:
        """Open the missions."""
        for i, rollout in enumerate(self._rollouts):
            try:
                self._calls[i] = next(rollout).call
            except StopIteration as end:
                self._results[i] = end.value

    @property
    def calls(self) -> list[LoopCall]:
        """The calls of the loops of the missions that are open."""
        return list(self._calls.values())

    def list_rules(self) -> Iterator[Named]:
        """Yield the rules of the missions.

        Raises:
            NoKernel: a random generator is of another kind than those of missions.
        """
        for call in self._calls.values():
            yield from _list_rules(call.inputs)

    def finish(self, results: Iterator[LoopResult]) -> list[Rollout]:
        """Take the results of these calls, and return the outcomes of all missions."""
        for i in self._calls:
            self._seats[i].result = next(results)
        self._results |= {i: finish(self._rollouts[i]) for i in self._calls}
        return [self._results[i] for i in range(len(self._rollouts))]

    def close(self) -> None:
        """End the missions that are still open."""
        for rollout in self._rollouts:
            rollout.close()


def _open(scenario: Scenario, missions: Sequence[Mission], stack: ExitStack) -> _Group | NoKernel:
    """Open the missions of a scenario until a stack ends, or return why they have no kernel."""
    if scenario.is_live or not isinstance(scenario.simulator, RuleSimulator):
        return NoKernel("their simulator or a controller is not compiled")
    group = stack.enter_context(closing(_Group(scenario, missions)))
    group.open()
    return group


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

"""Runs the missions of several scenarios in one kernel launch on a device."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from typing import Any

from numpy.random import PCG64

from evoros.base.errors import EvorosError, InputError, SimulationError
from evoros.compilation.device import Device, DeviceFull
from evoros.compilation.kernel import RULES, make_kernel
from evoros.compilation.machine_code import Lowered
from evoros.compilation.named_rules import name_rule
from evoros.compilation.rules import NotCompilable, try_compile
from evoros.mission.inputs import LoopCall, LoopResult
from evoros.mission.memory_image import ROW_SIZE, Image, lower_loop
from evoros.mission.mission import Mission
from evoros.mission.rollout import OpenMission, Rollout, open_mission, take_failure
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import RuleSimulator

Named = tuple[str, Any]  # (kind, rule)


class NoKernel(EvorosError):
    """A kernel cannot run the missions, which then run one by one."""


class Batcher:
    """Runs missions on a device with a kernel that contains all rules used so far."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._numbers: dict[Any, int] = {}
        self._rules: dict[Named, Lowered] = {}
        self._kernel: Any = None

    def run(
        self, asked: Sequence[tuple[Scenario, Sequence[Mission]]]
    ) -> list[list[Rollout] | NoKernel]:
        """Run missions of several scenarios in one launch, with the results of ``run_mission``.

        If kernels cannot run a rule of a scenario, the reason replaces its rollouts. A DeviceError
        means that the device cannot be used.
        """
        with ExitStack() as stack:
            groups = self._prepare([_open(*pair, stack) for pair in asked])
            calls = [call for group in groups if isinstance(group, _Group) for call in group.calls]
            results = iter(self._launch(calls))
            return [g.finish(results) if isinstance(g, _Group) else g for g in groups]

    def _prepare(self, groups: Sequence["_Group | NoKernel"]) -> list["_Group | NoKernel"]:
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
        new = sorted(rules - self._rules.keys(), key=lambda rule: (rule[0], name_rule(rule[1])))
        if not new:
            return
        known, numbers = dict(self._rules), dict(self._numbers)
        for kind, rule in new:
            compiled = try_compile(rule, RULES[kind].signature)
            if isinstance(compiled, NotCompilable):
                raise NoKernel(f"{name_rule(rule)} is not compiled: {compiled}")
            if not compiled.borrows:
                raise NoKernel(f"{name_rule(rule)} creates arrays or other objects")
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


class _Group:
    def __init__(self, scenario: Scenario, missions: Sequence[Mission], stack: ExitStack) -> None:
        self._scenario, self._missions = scenario, missions
        self._opened: dict[int, OpenMission] = {}
        self._failed: dict[int, Rollout] = {}  # results of missions that could not be opened
        for i, mission in enumerate(missions):
            try:
                self._opened[i] = stack.enter_context(open_mission(scenario, mission))
            except (InputError, SimulationError) as error:
                self._failed[i] = take_failure(scenario, mission, error)
        self.calls = [opened.call for opened in self._opened.values()]

    def list_rules(self) -> Iterator[Named]:
        for call in self.calls:
            inputs = call.inputs
            yield from zip(("observe", "sense", "advance"), inputs[:3], strict=True)
            for stage in (*inputs.filters, *inputs.localization, *inputs.actuation):
                if type(stage.rng.bit_generator) is not PCG64:
                    raise NoKernel(f"{name_rule(stage.rule)} does not draw from a PCG64 generator")
                yield "filter", stage.rule
            for layer in inputs.layers:
                yield "layer", layer.rule

    def finish(self, results: Iterator[LoopResult]) -> list[Rollout]:
        rollouts = dict(self._failed)
        for i, opened in self._opened.items():
            try:
                rollouts[i] = opened.finish(next(results))
            except SimulationError as error:
                rollouts[i] = take_failure(self._scenario, self._missions[i], error)
        return [rollouts[i] for i in range(len(self._missions))]


def _open(scenario: Scenario, missions: Sequence[Mission], stack: ExitStack) -> _Group | NoKernel:
    if scenario.is_live or not isinstance(scenario.simulator, RuleSimulator):
        return NoKernel("the simulator or a controller cannot be compiled")
    return _Group(scenario, missions, stack)

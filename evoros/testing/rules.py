"""Conformance tests for parts with a rule, both interpreted and compiled."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.core.runtime import _nrt_python, rtsys

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, NO_VALUES, POSE_SIZE, STATE_SIZE, Array
from evoros.base.packing import unpack
from evoros.base.rng import Generator, generator
from evoros.compilation.named_rules import UNUSED, Bound, Started, bind
from evoros.compilation.rules import CompiledRule, NotCompilable, compile_rule
from evoros.testing.part import PartSuite, bits

TICKS, PERIOD_S = 5, 0.1
SEEDS = range(10)
READINGS = (0.3, 1.7, 4.5, np.nan)  # [m]: two in range, a sonar's maximum, and a missing one


class RuleCase(NamedTuple):
    """A rule, its initial values, and the lengths of arrays that depend on the robot."""

    rule: Callable[..., Any]
    arguments: tuple[str, ...]
    started: Started
    lengths: Mapping[str, int]

    def bind(self) -> Bound:
        """Return the rule with new parameters and memory."""
        return bind(self.rule, self.arguments, self.started)

    def draw(self, inputs: np.random.Generator, rng: Generator, time: float) -> dict[str, Any]:
        """Draw the arguments of a call by name, except parameters and memory."""
        drawn: dict[str, Array] = {
            "values": inputs.choice(READINGS, self.lengths.get("values", POSE_SIZE)),
            "readings": inputs.choice(READINGS, self.lengths.get("readings", 0)),
            "signal": inputs.uniform(-1.0, 1.0, self.lengths.get("signal", 0)),
            "pose": inputs.uniform(-1.0, 1.0, POSE_SIZE),
            "state": inputs.uniform(-1.0, 1.0, STATE_SIZE),
            "leg": inputs.uniform(-5.0, 5.0, LEG_SIZE),
            "command": np.zeros(COMMAND_SIZE),
            UNUSED: NO_VALUES,
        }
        given = {**drawn, "rng": rng, "time": time}
        return {name: given[name] for name in self.arguments[2:]}


class RuleSuite(PartSuite):
    """Conformance tests for a rule: equal results when compiled, and no allocations."""

    signature: ClassVar[Any]  # numba signature of this kind of rule
    fills: ClassVar[str]  # name of the argument that the rule may change
    compiles: ClassVar[bool] = True  # False if it cannot be compiled, as it raises errors

    def start_rules(self, part: Any, seed: int) -> Sequence[RuleCase]:
        """Start the part's rules for one mission."""
        raise NotImplementedError

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Start the rules, and call each for several ticks."""
        for case in self.start_rules(part, seed):
            yield from self.play(case, case.bind().__call__, seed)

    def play(self, case: RuleCase, rule: Callable[..., Any], seed: int) -> Iterator[Any]:
        """Call a rule for several ticks; yield its return value, the arrays and a random draw."""
        inputs, rng = np.random.default_rng(seed), generator(str(seed), "rule")
        for tick in range(TICKS):
            given = case.draw(inputs, rng, tick * PERIOD_S)
            for name, value in given.items():
                if name not in ("rng", self.fills):
                    self.lend(value)
            answer = rule(*given.values())
            arrays = [value for value in given.values() if isinstance(value, np.ndarray)]
            yield bool(answer), arrays, rng.random()

    def compile(self, case: RuleCase) -> tuple[CompiledRule, Bound]:
        """Return the compiled rule, and the rule bound to its parameters and memory."""
        bound = case.bind()
        try:
            return compile_rule(bound.rule, self.signature), bound
        except NotCompilable as error:
            fix = "set `compiles = False` if missions with the part may run interpreted"
            raise AssertionError(f"numba cannot compile the rule ({error}); {fix}") from error

    def test_a_start_keeps_its_values(self) -> None:
        """The rule uses the parameters and memory returned by ``start``."""
        for case in self.start_rules(self.part, 1):
            bound, started = case.bind(), case.started
            pair: Any = started if type(started) is tuple else (started, None)
            kinds = bound.rule.parameters, bound.rule.memory
            arrays = bound.parameters, bound.memory
            for values, kind, packed in zip(pair, kinds, arrays, strict=True):
                if values is not None:
                    floats = [np.float64(value) for value in values]
                    assert bits([np.float64(v) for v in unpack(kind, packed)]) == bits(floats)

    def test_compiled_rules_give_the_bits_of_interpreted_ones(self) -> None:
        """A compiled rule gives the same results, memory and random draws as Python."""
        for seed in SEEDS if self.compiles else ():
            for case in self.start_rules(self.part, seed):
                code, bound = self.compile(case)
                compiled = self.play(case, partial(code, bound.parameters, bound.memory), seed)
                interpreted = case.bind()
                steps = zip(compiled, self.play(case, interpreted.__call__, seed), strict=True)
                for tick, (fast, slow) in enumerate(steps):
                    same = bits((fast, bound.memory)) == bits((slow, interpreted.memory))
                    assert same, f"at tick {tick}, compiled code must return {slow}, not {fast}"

    def test_compiled_rules_allocate_nothing(self) -> None:
        """Compiled rules allocate no memory, because they run for every sample."""
        for seed in SEEDS if self.compiles else ():
            for case in self.start_rules(self.part, seed):
                code, bound = self.compile(case)
                allocated = [
                    count_allocations(code, bound.parameters, bound.memory, *given.values())
                    for given in self.draw_calls(case, seed)
                ]
                most = max(allocated)
                assert not most, (
                    f"the compiled rule must not allocate memory ({most} times per call)"
                )

    def draw_calls(self, case: RuleCase, seed: int) -> Iterator[dict[str, Any]]:
        """Draw the arguments of several calls."""
        inputs, rng = np.random.default_rng(seed), generator(str(seed), "rule")
        for tick in range(TICKS):
            yield case.draw(inputs, rng, tick * PERIOD_S)


def count_allocations(code: CompiledRule, *arguments: Any) -> int:
    """Return the number of memory requests in a call, except those that numba always makes."""
    _nrt_python.memsys_enable_stats()  # numba's tests use this as well
    before = rtsys.get_allocation_stats().alloc
    code(*arguments)
    taken = rtsys.get_allocation_stats().alloc - before
    owned = Generator if code.borrows else (Generator, np.ndarray)
    return int(taken) - sum(isinstance(argument, owned) for argument in arguments)

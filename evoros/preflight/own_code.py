"""Tries the user's code before a run, to report errors and nondeterminism."""

from collections.abc import Sequence
from concurrent.futures import CancelledError
from typing import Any

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE, Array
from evoros.base.checks import Rule, check_answer, find_source
from evoros.base.compilable import is_bundled
from evoros.base.errors import EvorosError, PartFault, single_line
from evoros.compilation.named_rules import NamedRule, name_rule
from evoros.compilation.rules import interpret_rule
from evoros.controller.protocol import COMMAND
from evoros.dispatch.calls import pack, run_for_trajectory
from evoros.executor.protocol import Pool
from evoros.mission.inputs import LoopInputs
from evoros.mission.mission import TIME, Mission
from evoros.mission.plan import describe
from evoros.mission.scenario import Scenario
from evoros.terminal.log import LOGGER

TRUTH = Rule("True or False", lambda v: isinstance(v, bool | int | np.bool_))


def try_rules(inputs: LoopInputs, readings: int) -> None:
    """Call users' rules for sensors, filters and layers, with readings and signals of 1."""
    for stage in (*inputs.filters, *inputs.localization, *inputs.actuation):
        source, values = np.ones_like(stage.source), np.ones_like(stage.values)
        memory = stage.parameters.copy(), stage.memory.copy()
        _call(stage.rule, *memory, stage.rng, source, values, 0.0)
    for layer in inputs.layers:
        command, leg = np.zeros(COMMAND_SIZE), np.arange(float(LEG_SIZE))
        memory = layer.parameters.copy(), layer.memory.copy()
        seen = np.zeros(STATE_SIZE), leg, np.ones(readings)
        answer = _call(layer.rule, *memory, *seen, 0.0, command)
        if answer is not FOREIGN:
            function: Any = layer.rule
            check_answer("", function.function, TRUTH, answer)
            check_answer("", function.function, COMMAND, command)


FOREIGN = object()  # result for rules that are not user-defined


def _call(rule: Any, *arguments: Any) -> Any:
    if not isinstance(rule, NamedRule) or is_bundled(rule.function):
        return FOREIGN
    try:
        return interpret_rule(rule)(*arguments)
    except EvorosError:
        raise
    except Exception as error:  # a user's rule may raise any exception
        raise PartFault(
            f"{name_rule(rule)}: {type(error).__name__}: {single_line(error)}; correct "
            f"{find_source(rule.function)}"
        ) from error


def report_repeatability(scenario: Scenario, mission: Mission, pool: Pool) -> None:
    """Let workers run a mission with live controllers twice; log any difference."""
    if not scenario.is_live:
        return
    packed = pack(scenario)
    futures = [pool.submit(run_for_trajectory, packed, mission) for _ in range(2)]
    try:
        first, second = (future.result() for future in futures)
    except CancelledError:  # the run was interrupted, which closed the pool
        raise
    except Exception:  # the run will report the error
        return
    columns = scenario.name_columns(mission.design, mission.world)
    difference = find_difference(first, second, columns)
    if difference:
        LOGGER.warning(
            f"controller: {describe(mission)} was run twice, and {difference}, so results that "
            "depend on the controller cannot be repeated exactly; plugins/ros/README.md lists "
            "possible causes"
        )


def find_difference(first: Array, second: Array, columns: Sequence[str]) -> str:
    """Describe the first difference between two trajectories (rows, columns), or return ""."""
    rows = min(len(first), len(second))
    same = (first[:rows] == second[:rows]) | (np.isnan(first[:rows]) & np.isnan(second[:rows]))
    differing = np.flatnonzero(~same.all(axis=1))
    if len(differing):
        row = int(differing[0])
        column = int(np.flatnonzero(~same[row])[0])
        values = f"{columns[column]} {first[row, column]:g} and {second[row, column]:g}"
        return f"the two runs differ from tick {row} on, at {first[row, TIME]:g} s ({values})"
    if len(first) != len(second):
        times = f"{first[-1:, TIME].sum():g} and {second[-1:, TIME].sum():g} s"
        return f"the two runs differ from tick {rows} on, because they end at {times}"
    return ""

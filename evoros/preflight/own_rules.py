"""Calls each user-defined rule once in Python, where errors are detected.

Compiled rules check neither indices nor divisions.
"""

from typing import Any

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, LEG_SIZE, STATE_SIZE
from evoros.base.checks import Rule, check_answer, find_source
from evoros.base.compilable import is_bundled
from evoros.base.errors import EvorosError, PartFault, single_line
from evoros.compilation.named_rules import NamedRule, name_rule
from evoros.compilation.rules import interpret_rule
from evoros.controller.protocol import COMMAND
from evoros.mission.inputs import LoopInputs

TRUTH = Rule("True or False", lambda v: isinstance(v, bool | int | np.bool_))


def try_rules(inputs: LoopInputs, readings: int) -> None:
    """Call users' rules of sensors, filters and layers with readings and signals of 1."""
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


FOREIGN = object()
"""The result for a rule that is not user-defined."""


def _call(rule: Any, *arguments: Any) -> Any:
    if not isinstance(rule, NamedRule) or is_bundled(rule.function):
        return FOREIGN
    try:
        return interpret_rule(rule)(*arguments)
    except EvorosError:
        raise
    except Exception as error:  # a user's rule may raise anything
        raise PartFault(
            f"{name_rule(rule)}: {type(error).__name__}: {single_line(error)}; fix "
            f"{find_source(rule.function)}"
        ) from error

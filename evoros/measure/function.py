"""A measure computed by a user's function of a design and its outcomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import FLAG, TEXT, Rule, checked
from evoros.measure.coverage import A_NAME
from evoros.measure.protocol import BOUNDS, DIRECTION, MAXIMIZE, Evaluated, Measure

FUNCTION = Rule("a function; set _target_ to the function, and _partial_ to true", callable)


@dataclass(frozen=True)
@checked
class Function(Measure):
    """A measure computed by a function, which maps an ``Evaluated`` to a finite number."""

    function: Annotated[Callable[[Evaluated], float], FUNCTION]
    title: Annotated[str, TEXT]
    bounds: Annotated[Sequence[float], BOUNDS]
    direction: Annotated[str, DIRECTION] = MAXIMIZE
    unit: Annotated[str, A_NAME] = ""
    of_design: Annotated[bool, FLAG] = False  # True: uses no outcomes, fitness or score

    def compute(self, evaluated: Evaluated) -> float:
        return float(self.function(evaluated))

"""The controls of a run: designs that its champion is expected to beat."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import COUNT, TEXT, Rule, checked, instance_of

NO_SENSORS, RANDOM = "no_sensors", "random"
DESIGNS = Rule(
    f"a list of distinct entries: {NO_SENSORS}, {RANDOM} or CSV files of designs",
    lambda v: isinstance(v, list | tuple) and all(map(TEXT.holds, v)) and 0 < len(v) == len(set(v)),
)


@dataclass(frozen=True)
@checked
class Controls:
    """Designs that are compared with the champion of a finished run, on the same fresh draws.

    ``NO_SENSORS`` is the champion without sensors, ``RANDOM`` the best of as many random designs
    as the run evaluated, and any other string a CSV file of hand-made designs.
    """

    designs: Annotated[Sequence[str], DESIGNS] = (NO_SENSORS, RANDOM)
    trials: Annotated[int, COUNT] = 40  # missions of each design per world


SOME_CONTROLS = instance_of(Controls, "controls (evoros.certificate.controls.Controls)")

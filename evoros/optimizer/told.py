"""What every optimizer expects to be told."""

import math
from collections.abc import Sequence

from evoros.errors import InputError
from evoros.search import Individual


def check_told(fitness: Sequence[float], asked: Sequence[Individual]) -> None:
    """There must be one number, not NaN, for each individual asked for.

    Raises:
        InputError: there is not.
    """
    if len(fitness) != len(asked) or any(map(math.isnan, fitness)):
        raise InputError(
            f"fitness: must be {len(asked)} numbers, not {list(fitness)}; "
            f"give one for each individual asked for"
        )

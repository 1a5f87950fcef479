"""The number of a champion's trials."""

import pytest

from evoros.base.errors import InputError
from evoros.certificate.final_choice import FinalChoice
from evoros.certificate.validation import Validation


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ({"precision": 0.0}, "precision"),
        ({"trials": 0}, "trials"),
        ({"trials": 6, "max_trials": 5}, "set validation.max_trials=6"),
        ({"confidence": 95}, "confidence"),
        ({"rivals": -1}, "rivals"),
    ],
)
def test_values_out_of_range_are_refused(bad: dict[str, float], name: str) -> None:
    with pytest.raises(InputError, match=name):
        Validation(**bad)  # type: ignore[arg-type]


def test_a_final_choice_names_the_value_that_it_cannot_use() -> None:
    with pytest.raises(InputError, match="method"):
        FinalChoice(method="halving")  # type: ignore[arg-type]

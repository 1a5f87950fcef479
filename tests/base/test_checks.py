import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from evoros.base.checks import (
    COUNT,
    NOT_NEGATIVE,
    POSITIVE,
    TEXT,
    Rule,
    checked,
    instance_of,
    invalid,
    mapping_of,
    pick_index,
    scale,
)
from evoros.base.errors import InputError

EVEN = Rule("even", lambda value: value % 2 == 0)


@dataclass(frozen=True)
@checked
class Part:
    size_m: Annotated[float, POSITIVE]
    limit_m: Annotated[float | None, POSITIVE] = None
    pairs: Annotated[int, COUNT, EVEN] = 2
    inner: Annotated["Mapping[str, Part]", mapping_of(object, "parts")] = field(
        default_factory=dict
    )
    note: str = ""
    kind: ClassVar[Annotated[str, TEXT]] = ""


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Part(0), "Part.size_m: must be a positive number, not 0"),
        (lambda: Part(True), "Part.size_m: must be a positive number, not True"),
        (lambda: Part(1, 0), "Part.limit_m: must be a positive number, not 0"),
        (lambda: Part(1, pairs=0), "Part.pairs: must be a positive integer, not 0; for "),
        (lambda: Part(1, pairs=3), "Part.pairs: must be even, not 3; for example, set it to"),
        (lambda: Part(1, inner=1), "Part.inner: must be a mapping from names to parts"),  # type: ignore[arg-type]
        (lambda: Part(1, limit_m={"a": 1}), "add _target_ with the class that accepts these keys"),  # type: ignore[arg-type]
    ],
)
def test_a_field_that_breaks_its_rule_is_named_with_the_rule_and_the_value(
    make: Callable[[], object], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_example_of_an_error_is_the_default_of_the_field() -> None:
    with pytest.raises(InputError, match=r"; for example, set it to 2$"):
        Part(1, pairs=-1)


def test_only_a_field_that_may_be_none_is_let_off_its_rule() -> None:
    assert Part(1, None).limit_m is None
    with pytest.raises(InputError, match=r"size_m: .* not None"):
        Part(None)  # type: ignore[arg-type]


def test_checks_of_several_fields_see_only_fields_that_keep_their_rules() -> None:
    seen: list[tuple[float, float]] = []

    @dataclass(frozen=True)
    @checked
    class Window:
        low: Annotated[float, NOT_NEGATIVE]
        high: Annotated[float, NOT_NEGATIVE]

        def __post_init__(self) -> None:
            seen.append((self.low, self.high))
            if self.low > self.high:
                raise invalid(self, "low", self.low, "must be at most high", "lower it")

    with pytest.raises(InputError, match=r"Window\.high: must be a non-negative number"):
        Window(1, -1)
    assert not seen
    with pytest.raises(InputError, match=r"^Window\.low: must be at most high, not 2; lower it$"):
        Window(2, 1)
    assert Window(1, 2).high == 2
    assert seen == [(2, 1), (1, 2)]


def test_a_subclass_keeps_the_rules_of_its_base() -> None:
    @dataclass(frozen=True)
    @checked
    class Base:
        size_m: Annotated[float, POSITIVE] = 1.0

    @dataclass(frozen=True)
    class Plain(Base):
        name: str = ""

    @dataclass(frozen=True)
    @checked
    class Strict(Base):
        name: Annotated[str, TEXT] = "a"

    for kind in (Plain, Strict):
        with pytest.raises(InputError, match=rf"{kind.__name__}\.size_m"):
            kind(-1)
    with pytest.raises(InputError, match=r"Strict\.name"):
        Strict(1, "")


def test_a_value_of_many_characters_is_quoted_in_part() -> None:
    with pytest.raises(InputError) as caught:
        Part("x" * 10_000)  # type: ignore[arg-type]
    assert len(str(caught.value)) < 200


def test_a_rule_may_be_about_a_class_that_is_defined_later() -> None:
    @dataclass(frozen=True)
    @checked
    class Tree:
        parent: Annotated["Part | None", instance_of(Part, "a part")] = None

    assert Tree().parent is None
    with pytest.raises(InputError, match=r"Tree\.parent: must be a part, not 1"):
        Tree(1)  # type: ignore[arg-type]


@given(st.floats(0, 1), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
@example(1.0, -0.1, -0.01)  # -0.1 + (-0.01 - -0.1) is greater than -0.01
def test_rounding_never_leaves_an_interval(gene: float, one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert low <= scale(gene, low, high) <= high
    assert scale(0, low, high) == low
    assert abs(scale(1, low, high) - high) <= math.ulp(max(abs(low), abs(high), high - low))


@given(st.integers(1, 1000), st.data())
def test_each_choice_has_its_own_share_of_the_interval(count: int, data: st.DataObject) -> None:
    index = data.draw(st.integers(0, count - 1))
    assert pick_index((index + 0.5) / count, count) == index
    assert (pick_index(0.0, count), pick_index(1.0, count)) == (0, count - 1)

"""The checks of every kind of part."""

import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any, ClassVar, TypeVar

from evoros.testing.bad_values import find_problem, list_bad_values
from evoros.testing.outside import global_seed, later
from evoros.testing.values import bits

T = TypeVar("T")


class DescriptionSuite:
    """The checks of the description of any part: a class with fields that a YAML file sets.

    A test class inherits the suite of its kind and sets ``part``. It may set ``bad_values``, too:
    fields that must be refused, such as ``{"low": 2.0, "high": 1.0}``.
    """

    part: Any
    bad_values: Sequence[Mapping[str, Any]] = ()
    protocol: ClassVar[Any]

    def test_it_keeps_the_protocol(self) -> None:
        """It has the attributes and methods of its kind."""
        assert isinstance(self.part, self.protocol), (
            f"{type(self.part).__name__} lacks attributes or methods of {self.protocol.__name__}"
        )

    def test_it_is_a_frozen_dataclass(self) -> None:
        """Nobody can change a description, so a mission cannot leave a trace in it."""
        assert is_dataclass(self.part), f"{type(self.part).__name__} must be a dataclass"
        try:
            setattr(self.part, "trace_of_the_suite", 0)  # noqa: B010 - no field has this name
        except AttributeError:
            return
        raise AssertionError(f"{type(self.part).__name__} must be @dataclass(frozen=True)")

    def test_it_pickles(self) -> None:
        """A worker process gets an equal part."""
        assert bits(self.copy()) == bits(self.part), "pickling changes the fields of the part"

    def copy(self) -> Any:
        """Return the part as a worker process gets it."""
        try:
            return pickle.loads(pickle.dumps(self.part))
        except Exception as error:
            raise AssertionError(f"the part cannot be pickled: {error!r}") from error

    def test_bad_values_are_refused_in_one_line(self) -> None:
        """A value that breaks the rule of its field is an InputError that names the field."""
        derived = list_bad_values(self.part) if fields(self.part) else ()
        problems = (find_problem(self.part, values) for values in (*derived, *self.bad_values))
        reported = [problem for problem in problems if problem]
        assert not reported, "\n".join(reported)


class PartSuite(DescriptionSuite):
    """The checks of a part that computes; the suite of each kind says how it is used."""

    together: ClassVar[bool] = True  # whether two uses may overlap

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Use a part as evoros does, and yield what it gives, step by step."""
        raise NotImplementedError

    def lend(self, value: T) -> T:
        """Return an argument that the part must not change."""
        self.lent.append((value, bits(value)))
        return value

    @cached_property
    def lent(self) -> list[tuple[Any, Any]]:
        """The arguments that the part must not change, with their bits."""
        return []

    def record(self, part: Any, seed: int) -> list[Any]:
        """Return the bits of each step of a use."""
        return [bits(step) for step in self.use(part, seed)]

    def test_equal_uses_give_equal_bits(self) -> None:
        """The same arguments and random streams give the same results."""
        assert self.record(self.part, 1) == self.record(self.part, 1), (
            "two equal uses give different results"
        )

    def test_uses_share_no_state(self) -> None:
        """A use gives the same results after another one, and while another one goes on."""
        alone, steps = self.record(self.part, 1), []
        other = self.use(self.part, 2) if self.together else iter(self.record(self.part, 2))
        for step in self.use(self.part, 1):
            steps.append(bits(step))
            next(other, None)
        assert steps == alone, "a use changes the results of another one"

    def test_fields_stay_as_they_are(self) -> None:
        """A use changes nothing in the description, nor in the lists and arrays in it."""
        before = bits(self.part)
        self.record(self.part, 1)
        assert bits(self.part) == before, "a use changes the fields of the part"

    def test_arguments_stay_as_they_are(self) -> None:
        """The part changes only what its protocol lets it change."""
        self.record(self.part, 1)
        for value, before in self.lent:
            assert bits(value) == before, f"the part changes an argument, which is now {value!r}"

    def test_the_clock_does_not_matter(self) -> None:
        """Nothing is seeded from the time."""
        now = self.record(self.part, 1)
        with later():
            then = self.record(self.part, 1)
        assert then == now, "the results depend on the clock"

    def test_global_random_generators_do_not_matter(self) -> None:
        """All draws are from the generators that the part is given."""
        records = []
        for seed in (1, 2):
            with global_seed(seed) as is_untouched:
                records.append(self.record(self.part, 1))
                assert is_untouched(), "the part draws from numpy.random or random"
        assert records[0] == records[1], "the results depend on numpy.random or random"

    def test_a_pickled_part_gives_equal_bits(self) -> None:
        """A worker process computes what this process does."""
        assert self.record(self.copy(), 1) == self.record(self.part, 1), "a pickled part differs"

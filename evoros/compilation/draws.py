"""Registers ``evoros.base.rng.Generator`` with numba, so that compiled draws are the same."""

from typing import Any

import numpy as np
from numba.core import types
from numba.core.cgutils import is_nonelike
from numba.extending import overload, overload_method, register_model, typeof_impl
from numba.np.random.generator_core import NumPyRandomGeneratorTypeModel, next_uint64

from evoros.base.compilable import compilable
from evoros.base.elementary import exp
from evoros.base.rng import Generator
from evoros.base.ziggurat import draw_exponential, draw_normal, next_word


class GeneratorType(types.NumPyRandomGeneratorType):
    """The numba type of ``Generator``."""

    def __init__(self) -> None:
        super().__init__("evoros")
        self.name = "evoros.Generator"


RNG = GeneratorType()
register_model(GeneratorType)(NumPyRandomGeneratorTypeModel)


@typeof_impl.register(Generator)  # type: ignore[untyped-decorator]
def _typeof(value: Generator, context: Any) -> GeneratorType:
    return RNG


@overload(next_word, strict=False)  # type: ignore[untyped-decorator]
def _next_word(bits: Any) -> Any:
    return lambda bits: next_uint64(bits)


# Not strict: numba would also compare the annotations.
@overload_method(GeneratorType, "standard_normal", strict=False, inline="always")  # type: ignore[untyped-decorator]
def _standard_normal(rng: Any, size: Any = None) -> Any:
    if is_nonelike(size):
        return lambda rng, size=None: draw_normal(rng.bit_generator)
    return lambda rng, size=None: _fill(draw_normal, rng.bit_generator, size)


@overload_method(GeneratorType, "standard_exponential", strict=False, inline="always")  # type: ignore[untyped-decorator]
def _standard_exponential(rng: Any, size: Any = None) -> Any:
    if is_nonelike(size):
        return lambda rng, size=None: draw_exponential(rng.bit_generator)
    return lambda rng, size=None: _fill(draw_exponential, rng.bit_generator, size)


@overload_method(GeneratorType, "normal", strict=False, inline="always")  # type: ignore[untyped-decorator]
def _normal(rng: Any, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> Any:
    return lambda rng, loc=0.0, scale=1.0, size=None: loc + scale * rng.standard_normal(size)


@overload_method(GeneratorType, "exponential", strict=False, inline="always")  # type: ignore[untyped-decorator]
def _exponential(rng: Any, scale: Any = 1.0, size: Any = None) -> Any:
    return lambda rng, scale=1.0, size=None: scale * rng.standard_exponential(size)


@overload_method(GeneratorType, "lognormal", strict=False, inline="always")  # type: ignore[untyped-decorator]
def _lognormal(rng: Any, mean: Any = 0.0, sigma: Any = 1.0, size: Any = None) -> Any:
    if is_nonelike(size):
        return lambda rng, mean=0.0, sigma=1.0, size=None: exp(
            mean + sigma * draw_normal(rng.bit_generator)
        )
    return None  # interpret rules that draw arrays from this distribution


@compilable
def _fill(draw: Any, bits: Any, size: Any) -> Any:
    values = np.empty(size)
    for i in range(values.size):
        values.flat[i] = draw(bits)
    return values

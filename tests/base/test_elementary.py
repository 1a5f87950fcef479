"""The elementary functions: their stated error, special values, and the same bits compiled."""

import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evoros.base import elementary
from evoros.base.arrays import Array, determinant, length, principal_axes, product
from evoros.base.elementary import exponential, inverse, logarithm, trigonometry
from evoros.compilation.elementary_arrays import atan2_all, cos_all, sin_all
from evoros.compilation.machine_code import NJIT_OPTIONS, compile_function, compiling
from evoros.compilation.rules import F8

Function = Callable[..., float]

STATED_ULP = dict.fromkeys(("sin", "cos", "exp", "log", "log1p", "power"), 1.0)
STATED_ULP |= dict.fromkeys(("asin", "acos", "sinh", "tanh"), 3.0)
STATED_ULP |= dict.fromkeys(
    ("tan", "atan", "atan2", "expm1", "log2", "log10", "cosh", "hypot"), 2.0
)
PRECISION = 1300  # bits: for the remainder of the greatest double by pi

CIRCULAR = ("sin", "cos", "tan", "asin", "acos", "atan")
ONE = (*CIRCULAR, "exp", "expm1", "log", "log1p", "log2", "log10", "sinh", "cosh", "tanh")
TWO = ("atan2", "hypot", "power")
EXACT: dict[str, Callable[..., Any]] = {
    "log2": lambda x: mpmath.log(x) / mpmath.log(2),
    "log10": lambda x: mpmath.log(x) / mpmath.log(10),
    "log1p": lambda x: mpmath.log(1 + x),
    "power": mpmath.power,
}
LIMITS = {"asin": 1.0, "acos": 1.0, "exp": 700.0, "expm1": 700.0, "sinh": 700.0, "cosh": 700.0}

finite = st.floats(allow_nan=False, allow_infinity=False)
near = st.floats(-10.0, 10.0)
anything = st.floats()
# Doubles that are nearest to multiples of a quarter turn, and others that are hard to reduce.
HARD = (
    1000000.0,
    6381956970095103.0 * 2.0**797,
    1.7976931348623157e308,
    math.pi,
    math.pi / 2,
    1e22,
    5.0e5 * math.pi,
    1000000.5,
)


@cache
def compiled(name: str) -> Function:
    function = getattr(elementary, name)
    with compiling():
        result: Function = compile_function(function, F8(*[F8] * (2 if name in TWO else 1)), False)
    return result


def error_ulp(name: str, *arguments: float) -> float:
    with mpmath.workprec(PRECISION):
        exact = EXACT.get(name) or getattr(mpmath, name)
        true = exact(*map(mpmath.mpf, arguments))
        value = getattr(elementary, name)(*arguments)
        return float(abs(mpmath.mpf(value) - true) / math.ulp(float(true)))


def bits(value: float) -> bytes:
    return b"nan" if value != value else np.float64(value).tobytes()


@pytest.mark.parametrize("name", ONE)
@settings(max_examples=30)
@given(x=near | finite)
def test_a_function_of_one_number_has_the_stated_error(name: str, x: float) -> None:
    limit = LIMITS.get(name, math.inf)
    if name.startswith("log"):
        x = abs(x) or 1.0
    elif abs(x) > limit:
        x = math.copysign(limit * math.frexp(x)[0] ** 2, x)
    if abs(x) < 1e-290:
        x = 1e-290
    assert error_ulp(name, x) < STATED_ULP[name]


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
@pytest.mark.parametrize("x", HARD)
def test_an_angle_near_a_quarter_turn_has_the_stated_error(name: str, x: float) -> None:
    for angle in (x, -x, math.nextafter(x, 0.0)):
        assert error_ulp(name, angle) < STATED_ULP[name]


@settings(max_examples=30)
@given(quarters=st.integers(-(10**7), 10**7), offset=st.floats(-1e-6, 1e-6))
def test_angles_beside_any_quarter_turn_have_the_stated_error(quarters: int, offset: float) -> None:
    angle = quarters * (math.pi / 2.0) + offset
    for name in ("sin", "cos", "tan"):
        if abs(angle) > 1e-290:
            assert error_ulp(name, angle) < STATED_ULP[name]


magnitudes = st.floats(1e-200, 1e200).flatmap(lambda x: st.sampled_from([x, -x])) | near.filter(
    lambda x: abs(x) > 1e-200
)


@settings(max_examples=40)
@given(y=magnitudes, x=magnitudes)
def test_functions_of_a_vector_have_the_stated_error(y: float, x: float) -> None:
    assert error_ulp("hypot", y, x) < STATED_ULP["hypot"]
    if abs(math.atan2(y, x)) > 1e-290:
        assert error_ulp("atan2", y, x) < STATED_ULP["atan2"]


@settings(max_examples=40)
@given(x=st.floats(1e-300, 1e300) | st.floats(0.5, 2.0), y=near | st.floats(-1e4, 1e4))
def test_a_power_has_the_stated_error(x: float, y: float) -> None:
    if abs(y * math.log(x)) < 700.0:
        assert error_ulp("power", x, y) < STATED_ULP["power"]


@pytest.mark.parametrize("name", ONE)
@settings(max_examples=40)
@given(x=near | anything)
@example(x=0.0)
@example(x=-0.0)
@example(x=5e-324)
@example(x=709.7827128933840)
@example(x=-745.2)
def test_a_function_of_one_number_has_the_same_bits_compiled(name: str, x: float) -> None:
    assert bits(getattr(elementary, name)(x)) == bits(compiled(name)(x))


@pytest.mark.parametrize("name", TWO)
@settings(max_examples=40)
@given(y=near | anything, x=near | anything)
def test_a_function_of_two_numbers_has_the_same_bits_compiled(
    name: str, y: float, x: float
) -> None:
    assert bits(getattr(elementary, name)(y, x)) == bits(compiled(name)(y, x))


def coefficients(approximated: Function, limit: float, count: int) -> list[float]:
    """Return Chebyshev's approximation of a function on 0 <= z <= limit."""
    with mpmath.workdps(150):
        fit = mpmath.chebyfit(approximated, [mpmath.mpf(10) ** -40, limit], count, asc=True)
        return [float(value) for value in fit]


APPROXIMATIONS: dict[str, tuple[tuple[float, ...], Function, float]] = {
    "sine": (trigonometry.SINE, lambda z: (mpmath.sinc(mpmath.sqrt(z)) - 1) / z, 0.6169),
    "cosine": (
        trigonometry.COSINE,
        lambda z: (mpmath.cos(mpmath.sqrt(z)) - 1 + z / 2) / z**2,
        0.6169,
    ),
    "arctangent": (
        inverse.ARCTANGENT,
        lambda z: (mpmath.atan(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1) / z,
        0.1716,
    ),
    "exponential": (
        exponential.EXPONENTIAL,
        lambda z: (mpmath.sqrt(z) * mpmath.coth(mpmath.sqrt(z) / 2) - 2) / z,
        0.1202,
    ),
    "logarithm": (
        logarithm.LOGARITHM,
        lambda z: (2 * mpmath.atanh(mpmath.sqrt(z)) / mpmath.sqrt(z) - 2 - 2 * z / 3) / z**2,
        0.02944,
    ),
}


@pytest.mark.parametrize("name", APPROXIMATIONS)
def test_coefficients_are_those_of_the_approximation(name: str) -> None:
    values, approximated, limit = APPROXIMATIONS[name]
    assert list(values) == coefficients(approximated, limit, len(values))


def test_constants_are_those_of_mpmath() -> None:
    with mpmath.workprec(PRECISION):
        quarter, ln2 = mpmath.pi / 2, mpmath.log(2)
        parts = (trigonometry.PART_1, trigonometry.PART_2, trigonometry.PART_3)
        assert all(part.as_integer_ratio()[0].bit_length() <= 33 for part in parts[:2])
        assert parts[2] == float(quarter - parts[0] - parts[1])
        assert float(quarter - trigonometry.HALF_PI) == trigonometry.HALF_PI_REST
        digits = trigonometry.TWO_OVER_PI_BITS
        assert int(digits, 16) == int(mpmath.floor(mpmath.ldexp(1 / quarter, 4 * len(digits))))
        for high, low, true in (
            (exponential.LN2_1, exponential.LN2_2, ln2),
            (logarithm.LOG10_2_1, logarithm.LOG10_2_2, ln2 / mpmath.log(10)),
        ):
            assert high.as_integer_ratio()[0].bit_length() <= 42
            assert low == float(true - high)
        assert float(mpmath.mpf(2) / 3 - logarithm.THIRDS) == logarithm.THIRDS_REST


def test_known_values_are_exact() -> None:
    for k in range(23):
        assert elementary.log10(float(10**k)) == k
        assert elementary.power(10.0, float(k)) == 10.0**k
    for k in range(-1074, 1024):
        assert elementary.log2(math.ldexp(1.0, k)) == k
        assert elementary.power(2.0, float(k)) == math.ldexp(1.0, k)
    for x in range(1, 200):
        for y in range(int(53 / math.log2(x + 1)) + 1):
            assert elementary.power(-float(x), float(y)) == (-x) ** y
    for a, b, c in ((3.0, 4.0, 5.0), (5.0, 12.0, 13.0), (8.0, -15.0, 17.0)):
        assert elementary.hypot(a, b) == c
    for leg in (1.0, 2.5, 1e-300, 1e300):
        corners = ((leg, leg), (leg, -leg), (-leg, -leg), (-leg, leg))
        eighths = [elementary.atan2(y, x) / (math.pi / 4) for y, x in corners]
        assert eighths == [1.0, 3.0, -3.0, -1.0]


@given(x=anything)
def test_odd_and_even_functions_are_so_to_the_bit(x: float) -> None:
    for name in ("sin", "tan", "asin", "atan", "sinh", "tanh"):
        function = getattr(elementary, name)
        assert bits(function(-x)) == bits(-function(x))
    for name in ("cos", "cosh"):
        function = getattr(elementary, name)
        assert bits(function(-x)) == bits(function(x))


LIBRARY = {f"llvm.{item}.f64" for item in (*ONE, "pow", "exp2", "fma", "fmuladd")}
LIBRARY |= {*ONE, "atan2", "hypot", "pow", "fma", "sincos", "fmod"}

SPECIAL = (0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 3.0, -3.0, math.inf, -math.inf, math.nan)


@pytest.mark.parametrize(
    ("name", "reference"), [("atan2", math.atan2), ("hypot", math.hypot), ("power", np.float_power)]
)
def test_special_pairs_of_values_are_those_of_c(name: str, reference: Function) -> None:
    for y in SPECIAL:
        for x in SPECIAL:
            with np.errstate(all="ignore"):
                expected = float(reference(y, x))
            value = getattr(elementary, name)(y, x)
            assert value == pytest.approx(expected, rel=1e-15, nan_ok=True), (y, x)
            if expected == 0.0:
                assert math.copysign(1.0, value) == math.copysign(1.0, expected), (y, x)


NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}


@pytest.mark.parametrize("name", ONE)
def test_special_values_are_those_of_c(name: str) -> None:
    for x in (*SPECIAL, 5e-324, -5e-324, 1e308, -1e308):
        with np.errstate(all="ignore"):
            expected = float(getattr(np, NAMES.get(name, name))(x))
        value = getattr(elementary, name)(x)
        assert value == pytest.approx(expected, rel=1e-15, nan_ok=True), x
        if expected == 0.0:
            assert math.copysign(1.0, value) == math.copysign(1.0, expected), x


@given(x=anything)
def test_sine_and_cosine_together_are_those_alone(x: float) -> None:
    sine, cosine = elementary.sin_cos(x)
    assert bits(sine) == bits(elementary.sin(x))
    assert bits(cosine) == bits(elementary.cos(x))


def test_whole_arrays_have_the_bits_of_their_numbers() -> None:
    x = np.random.default_rng(3).uniform(-20.0, 20.0, (40, 3))
    y = x[::-1].copy()
    for array, function in ((sin_all(x), elementary.sin), (cos_all(x), elementary.cos)):
        assert array.shape == x.shape
        assert array.ravel().tolist() == [function(item) for item in x.ravel().tolist()]
    angles = atan2_all(y[:, 1], x[:, 1])
    assert angles.tolist() == [
        elementary.atan2(b, a) for a, b in zip(x[:, 1].tolist(), y[:, 1].tolist(), strict=True)
    ]


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_compiled_code_neither_fuses_operations_nor_calls_the_c_library(name: str) -> None:
    function: Any = compiled(name)
    (code,) = function.inspect_llvm().values()
    assert not [line for line in code.splitlines() if "llvm.fma" in line or " fast " in line]
    called = {word.strip('"') for word in re.findall(r"call [^@\n]*@(\S+?)\(", code)}
    assert not called & LIBRARY
    (assembly,) = function.inspect_asm().values()
    assert "vfmadd" not in assembly
    assert "fmla" not in assembly


def test_the_options_of_compiled_code_keep_the_order_of_operations() -> None:
    assert not NJIT_OPTIONS.get("fastmath")


numbers = st.floats(-10.0, 10.0)
matrices = arrays(np.float64, (3, 3), elements=numbers)


@given(a=arrays(np.float64, (5, 3), elements=numbers), b=matrices)
def test_a_product_is_that_of_numpy(a: Array, b: Array) -> None:
    np.testing.assert_allclose(product(a, b), a @ b, atol=1e-12)
    np.testing.assert_allclose(product(a, b[0]), a @ b[0], atol=1e-12)
    np.testing.assert_allclose(product(b[0], b), b[0] @ b, atol=1e-12)
    assert float(product(b[0], b[1])) == b[0, 0] * b[1, 0] + b[0, 1] * b[1, 1] + b[0, 2] * b[1, 2]


@given(a=matrices)
def test_the_determinant_is_that_of_numpy(a: Array) -> None:
    np.testing.assert_allclose(determinant(a), np.linalg.det(a), atol=1e-10)
    assert determinant(np.stack([a, a])).shape == (2,)


@given(a=matrices, scale=st.sampled_from([1e-9, 1.0, 1e9]))
def test_principal_axes_are_a_rotation_that_makes_a_matrix_diagonal(a: Array, scale: float) -> None:
    tensor = scale * (a + a.T)
    moments, axes = principal_axes(tensor)
    assert (np.diff(moments) >= 0.0).all()
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-13)
    assert np.linalg.det(axes) > 0.0
    np.testing.assert_allclose(axes * moments @ axes.T, tensor, atol=1e-12 * scale * 60.0)


def test_axes_of_a_diagonal_matrix_are_exact() -> None:
    moments, axes = principal_axes(np.diag([2.0, 1.0, 3.0]))
    assert moments.tolist() == [1.0, 2.0, 3.0]
    assert sorted(map(abs, axes.ravel().tolist())) == [0.0] * 6 + [1.0] * 3


@given(v=arrays(np.float64, 3, elements=numbers))
def test_the_length_is_that_of_numpy(v: Array) -> None:
    np.testing.assert_allclose(length(v), np.linalg.norm(v), rtol=1e-14)

"""Functions of numbers in compiled code that need nothing of Numba's runtime, as its own do.

What calls that can only be loaded with Numba (`core.machine_code`). `math.frexp` and `math.ldexp`
are C's, which leaves open what exponent belongs to what is not finite. A power of 0 is infinite
where its exponent is a negative integer, and a complex number over 0 is not a number, as all
divisions by 0 are here no error; Numba's raise. All else has the bits that Numba's have.
"""

from __future__ import annotations

import math
import operator
import sys
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_untracked, lower_builtin
from numba.extending import register_jitable

_DOUBLE = ir.DoubleType()


def _frexp(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `math.frexp(float)`."""
    exponent_type = context.get_data_type(sig.return_type[1])
    exponent = cgutils.alloca_once(builder, exponent_type)
    kind = ir.FunctionType(_DOUBLE, (_DOUBLE, exponent_type.as_pointer()))
    function = cgutils.get_or_insert_function(builder.module, kind, "frexp")
    digits = builder.call(function, (*args, exponent))
    both = cgutils.make_anonymous_struct(builder, (digits, builder.load(exponent)))
    return impl_ret_untracked(context, builder, sig.return_type, both)


def _ldexp(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `math.ldexp(float, int)`."""
    kind = ir.FunctionType(_DOUBLE, (_DOUBLE, context.get_data_type(sig.args[1])))
    function = cgutils.insert_pure_function(builder.module, kind, name="ldexp")
    function.args[1].add_attribute("signext")  # some systems' callers extend a C int
    return impl_ret_untracked(context, builder, sig.return_type, builder.call(function, args))


#: Above so large exponents Numba asks the general power.
_MOST = 0x10000


def _power(a: float, b: int) -> float:
    """Return a to the power of the size of b; where b is as large as to ask for it, to that of b.

    The squares and products are those of Numba's `int_power_impl`.
    """
    exponent = b if b >= 0 else -b
    if exponent > _MOST or exponent < 0:
        return math.pow(a, float(b))
    power = 1.0
    while exponent != 0:
        if exponent & 1:
            power *= a
        exponent >>= 1
        a *= a
    return power


def _pow(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `float ** int`, of which Numba raises where it divides by 0."""
    power = context.compile_internal(builder, _power, sig, args)
    word = args[1].type
    negative = builder.icmp_signed("<", args[1], ir.Constant(word, 0))
    inverted = builder.and_(negative, builder.icmp_signed(">=", args[1], ir.Constant(word, -_MOST)))
    inverse = builder.fdiv(ir.Constant(_DOUBLE, 1.0), power)
    found = builder.select(inverted, inverse, power)
    return impl_ret_untracked(context, builder, sig.return_type, found)


@register_jitable(error_model="numpy", no_cfunc_wrapper=True)
def _over(a: float, b: float) -> float:
    """Return a / b, which raises nothing whoever calls it."""
    return a / b


def _complex_quotient(a: complex, b: complex) -> complex:
    """Return a / b by R. L. Smith, Commun. ACM 5 (1962) 435, as Python before 3.14 and Numba do."""
    if abs(b.real) >= abs(b.imag):
        if b.real == 0.0:
            return complex(math.nan, math.nan)
        ratio = _over(b.imag, b.real)
        part = b.real + b.imag * ratio
        return complex(_over(a.real + a.imag * ratio, part), _over(a.imag - a.real * ratio, part))
    if abs(b.imag) >= abs(b.real):
        ratio = _over(b.real, b.imag)
        part = b.real * ratio + b.imag
        return complex(_over(a.real * ratio + a.imag, part), _over(a.imag * ratio - a.real, part))
    return complex(math.nan, math.nan)


def _complex_truediv(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `complex / complex`."""
    found = context.compile_internal(builder, _complex_quotient, sig, args)
    return impl_ret_untracked(context, builder, sig.return_type, found)


def install() -> None:
    """Put these before Numba's own."""
    if sys.version_info < (3, 14):  # from there on infinities are recovered
        lower_builtin(operator.truediv, types.complex128, types.complex128)(_complex_truediv)
    lower_builtin(operator.pow, types.float64, types.int64)(_pow)
    lower_builtin(math.frexp, types.float64)(_frexp)
    lower_builtin(math.ldexp, types.float64, types.intc)(_ldexp)

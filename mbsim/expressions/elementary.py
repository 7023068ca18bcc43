"""Elementary functions of jets: a value with its first and second derivative by time.

A jet is a 3-tuple (u, u', u''). `apply` replaces the topmost jets of a stack (deepest, 3) by a
function of them; compiled programs and the folding of constants are made of it. At the
end of a function's domain, where a derivative has no limit, the derivative is 0.

Source of the definitions: MSC Adams Solver, "Functions"; Altair MotionSolve, "Expressions".
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, scale, sub
from mbsim.expressions.functions import FUNCTIONS, Kind

# operations of the stack machine; elementary ones are below FIRST_MEASURE
_OPERATORS = ("ADD", "SUB", "MUL", "DIV", "POW", "NEG")
_ELEMENTARY = [name for name, entry in FUNCTIONS.items() if entry.kind is Kind.ELEMENTARY]
_NAMES = (*_OPERATORS, *_ELEMENTARY)
#: Operation code of each elementary function.
CODES = {name: 2 + k for k, name in enumerate(_NAMES)}
NUMBER, TIME = 0, 1
FIRST_MEASURE = 2 + len(_NAMES)

ADD, SUB, MUL, DIV, POW, NEG = (CODES[name] for name in _OPERATORS)
ABS, SIN, COS, TAN, ASIN, ACOS = (
    CODES[name] for name in ("ABS", "SIN", "COS", "TAN", "ASIN", "ACOS")
)
ATAN, SINH, COSH, TANH, EXP = (CODES[name] for name in ("ATAN", "SINH", "COSH", "TANH", "EXP"))
LOG, LOG10, SQRT, AINT, ANINT = (CODES[name] for name in ("LOG", "LOG10", "SQRT", "AINT", "ANINT"))
ATAN2, MOD, SIGN, DIM = (CODES[name] for name in ("ATAN2", "MOD", "SIGN", "DIM"))
MIN, MAX, IF, STEP, STEP5 = (CODES[name] for name in ("MIN", "MAX", "IF", "STEP", "STEP5"))
HAVSIN, SHF, POLY, CHEBY = (CODES[name] for name in ("HAVSIN", "SHF", "POLY", "CHEBY"))
FORSIN, FORCOS, IMPACT, BISTOP = (CODES[name] for name in ("FORSIN", "FORCOS", "IMPACT", "BISTOP"))
SWEEP = CODES["SWEEP"]

LN10 = math.log(10.0)


@jitable
def constant(c: float) -> V3:
    """Return a number as a jet."""
    return (c, 0.0, 0.0)


@jitable
def get(stack: F2, row: int) -> V3:
    """Return a row of the stack."""
    return (stack[row, 0], stack[row, 1], stack[row, 2])


@jitable
def put(stack: F2, row: int, u: V3) -> None:
    """Write a row of the stack."""
    stack[row, 0], stack[row, 1], stack[row, 2] = u[0], u[1], u[2]


@jitable
def chain(u: V3, f: float, f1: float, f2: float) -> V3:
    """Return the jet of f(u) from the values of f and its derivatives at u."""
    return (f, f1 * u[1], f2 * u[1] * u[1] + f1 * u[2])


@jitable
def times(u: V3, v: V3) -> V3:
    """Return u v."""
    return (u[0] * v[0], u[1] * v[0] + u[0] * v[1], u[2] * v[0] + 2.0 * u[1] * v[1] + u[0] * v[2])


@jitable
def over(u: V3, v: V3) -> V3:
    """Return u / v: from u = q v, q' = (u' - q v')/v and q'' = (u'' - 2 q' v' - q v'')/v."""
    q = u[0] / v[0]
    q1 = (u[1] - q * v[1]) / v[0]
    return (q, q1, (u[2] - 2.0 * q1 * v[1] - q * v[2]) / v[0])


@jitable
def sine(u: V3) -> V3:
    """Return sin u."""
    s, c = math.sin(u[0]), math.cos(u[0])
    return chain(u, s, c, -s)


@jitable
def cosine(u: V3) -> V3:
    """Return cos u."""
    s, c = math.sin(u[0]), math.cos(u[0])
    return chain(u, c, -s, -c)


@jitable
def root(u: V3) -> V3:
    """Return the square root of u; at 0 its derivatives are 0."""
    r = math.sqrt(u[0])
    if r == 0.0:
        return constant(0.0)
    return chain(u, r, 0.5 / r, -0.25 / (r * u[0]))


@jitable
def power(u: V3, v: V3) -> V3:
    """Return u^v."""
    n = v[0]
    if v[1] == 0.0 and v[2] == 0.0:
        if n == 2.0:
            return times(u, u)
        f = math.pow(u[0], n)
        # n u^(n-1) and n (n-1) u^(n-2) have no limit at u = 0 for small n
        f1 = n * math.pow(u[0], n - 1.0) if u[0] != 0.0 or n >= 1.0 else 0.0
        f2 = 0.0
        if n != 1.0 and (u[0] != 0.0 or n >= 2.0):
            f2 = n * (n - 1.0) * math.pow(u[0], n - 2.0)
        return chain(u, f, f1, f2)
    if u[0] == 0.0:
        return constant(math.pow(u[0], n))
    # u^v = exp(v ln u)
    f = math.pow(u[0], n)
    g = times(v, chain(u, math.log(u[0]), 1.0 / u[0], -1.0 / (u[0] * u[0])))
    return chain(g, f, f, f)


@jitable
def tangent(u: V3) -> V3:
    """Return tan u."""
    t = math.tan(u[0])
    slope = 1.0 + t * t
    return chain(u, t, slope, 2.0 * t * slope)


@jitable
def arc_sine(u: V3) -> V3:
    """Return asin u, its derivatives (1 - u^2)^-1/2 and u (1 - u^2)^-3/2."""
    c = 1.0 - u[0] * u[0]
    if c <= 0.0:
        return constant(math.asin(u[0]))
    f1 = 1.0 / math.sqrt(c)
    return chain(u, math.asin(u[0]), f1, u[0] * f1 / c)


@jitable
def arc_tangent2(u: V3, v: V3) -> V3:
    """Return atan2(u, v): a' = (u' v - u v') / (u^2 + v^2); 0 where both are 0."""
    square = u[0] * u[0] + v[0] * v[0]
    if square == 0.0:
        return constant(0.0)
    a1 = (u[1] * v[0] - u[0] * v[1]) / square
    growth = 2.0 * (u[0] * u[1] + v[0] * v[1])
    a2 = (u[2] * v[0] - u[0] * v[2] - a1 * growth) / square
    return (math.atan2(u[0], v[0]), a1, a2)


@jitable
def towards_zero(x: float) -> float:
    """Return x without its fraction, as a float for any size."""
    return math.copysign(float(math.floor(abs(x))), x)


@jitable
def absolute(u: V3) -> V3:
    """Return |u|."""
    return scale(-1.0, u) if u[0] < 0.0 else u


@jitable
def blend(x: V3, x0: V3, h0: V3, x1: V3, h1: V3, fifth: bool) -> V3:
    """Return STEP (s^2 (3 - 2 s)) or, if `fifth`, STEP5 (s^3 (10 - 15 s + 6 s^2)) of jets."""
    if x[0] <= x0[0]:
        return h0
    if x[0] >= x1[0]:
        return h1
    s = over(sub(x, x0), sub(x1, x0))
    a, r = s[0], 1.0 - s[0]
    if fifth:
        part = chain(
            s,
            a * a * a * (10.0 + a * (6.0 * a - 15.0)),
            30.0 * a * a * r * r,
            60.0 * a * r * (1.0 - 2.0 * a),
        )
    else:
        part = chain(s, a * a * (3.0 - 2.0 * a), 6.0 * a * r, 6.0 - 12.0 * a)
    return add(h0, times(sub(h1, h0), part))


@jitable
def haversine(x: V3, x0: V3, h0: V3, x1: V3, h1: V3) -> V3:
    """Return HAVSIN: half a period of a sine from h0 to h1."""
    if x[0] <= x0[0]:
        return h0
    if x[0] >= x1[0]:
        return h1
    s = over(sub(x, x0), sub(x1, x0))
    angle = sub(scale(math.pi, s), constant(0.5 * math.pi))
    return add(scale(0.5, add(h0, h1)), scale(0.5, times(sub(h1, h0), sine(angle))))


@jitable
def stop(depth: V3, rate: V3, stiffness: V3, exponent: V3, damping: V3, dmax: V3) -> V3:
    """Return max(0, k d^e + STEP(d, 0, 0, dmax, c) d'), 0 without depth."""
    zero = constant(0.0)
    if depth[0] <= 0.0:
        return zero
    damper = times(blend(depth, zero, zero, dmax, damping, False), rate)
    force = add(times(stiffness, power(depth, exponent)), damper)
    return force if force[0] > 0.0 else zero


@jitable
def two_stops(stack: F2, at: int) -> V3:
    """Return BISTOP(x, x', x1, x2, k, e, c, d): free between x1 and x2."""
    x, rate = get(stack, at), get(stack, at + 1)
    k, e, c, d = get(stack, at + 4), get(stack, at + 5), get(stack, at + 6), get(stack, at + 7)
    low = stop(sub(get(stack, at + 2), x), scale(-1.0, rate), k, e, c, d)
    high = stop(sub(x, get(stack, at + 3)), rate, k, e, c, d)
    return sub(low, high)


@jitable
def chirp(stack: F2, at: int) -> V3:
    """Return SWEEP(x, a, x0, f0, x1, f1, dx) = STEP5(x, x0, 0, x0 + dx, 1) a sin(2 pi h(x)).

    h = f0 x up to x0, then h' goes from f0 to f1 along a line, and h' = f1 from x1 on. Source: MSC
    Adams Solver, "SWEEP"; SolidWorks Motion, "SWEEP".
    """
    x, a = get(stack, at), get(stack, at + 1)
    x0, f0 = get(stack, at + 2), get(stack, at + 3)
    x1, f1 = get(stack, at + 4), get(stack, at + 5)
    if x[0] <= x0[0]:
        cycles = times(f0, x)
    elif x[0] < x1[0]:
        way = sub(x, x0)
        growth = over(sub(f1, f0), scale(2.0, sub(x1, x0)))
        cycles = add(times(f0, x), times(growth, times(way, way)))
    else:
        cycles = sub(times(f1, x), scale(0.5, times(sub(f1, f0), add(x1, x0))))
    on = blend(x, x0, constant(0.0), add(x0, get(stack, at + 6)), constant(1.0), True)
    return times(times(on, a), sine(scale(2.0 * math.pi, cycles)))


@jitable
def polynomial(stack: F2, at: int, count: int) -> V3:
    """Return POLY(x, x0, a0, a1..): the sum of a_j (x - x0)^j."""
    x = sub(get(stack, at), get(stack, at + 1))
    total = get(stack, at + count - 1)
    for k in range(count - 2, 1, -1):
        total = add(times(total, x), get(stack, at + k))
    return total


@jitable
def chebyshev(stack: F2, at: int, count: int) -> V3:
    """Return CHEBY(x, x0, a0, a1..): the sum of a_j T_j(x - x0), T_j+1 = 2 x T_j - T_j-1."""
    x = sub(get(stack, at), get(stack, at + 1))
    before, now = x, constant(1.0)  # T_-1 = T_1
    total = constant(0.0)
    for k in range(2, count):
        total = add(total, times(get(stack, at + k), now))
        before, now = now, sub(scale(2.0, times(x, now)), before)
    return total


@jitable
def fourier(stack: F2, at: int, count: int, sines: bool) -> V3:
    """Return FORSIN or FORCOS (x, x0, w, a0, a1..): a0 + the sum of a_j sin, cos(j w (x - x0))."""
    angle = times(get(stack, at + 2), sub(get(stack, at), get(stack, at + 1)))
    total = get(stack, at + 3)
    for k in range(4, count):
        turned = scale(float(k - 3), angle)
        wave = sine(turned) if sines else cosine(turned)
        total = add(total, times(get(stack, at + k), wave))
    return total


@jitable
def harmonic(stack: F2, at: int, count: int) -> V3:
    """Return SHF(x, x0, a, w, phi, b) = a sin(w (x - x0) - phi) + b; phi and b may be absent."""
    angle = times(get(stack, at + 3), sub(get(stack, at), get(stack, at + 1)))
    if count > 4:
        angle = sub(angle, get(stack, at + 4))
    wave = times(get(stack, at + 2), sine(angle))
    return add(wave, get(stack, at + 5)) if count > 5 else wave


@jitable
def extreme(stack: F2, at: int, count: int, sign: float) -> V3:
    """Return the largest (sign 1) or smallest (-1) of `count` jets."""
    best = at
    for k in range(at + 1, at + count):
        if sign * stack[k, 0] > sign * stack[best, 0]:
            best = k
    return get(stack, best)


@jitable
def of_one(op: int, u: V3) -> V3:  # noqa: C901
    """Return a function of one jet.

    Many branches because of a chain of equalities a table of jumps is made.
    """
    x = u[0]
    if op == NEG:
        return scale(-1.0, u)
    if op == ABS:
        return absolute(u)
    if op == SIN:
        return sine(u)
    if op == COS:
        return cosine(u)
    if op == TAN:
        return tangent(u)
    if op == ASIN:
        return arc_sine(u)
    if op == ACOS:
        return sub(constant(0.5 * math.pi), arc_sine(u))
    if op == ATAN:
        slope = 1.0 / (1.0 + x * x)
        return chain(u, math.atan(x), slope, -2.0 * x * slope * slope)
    if op == SINH:
        return chain(u, math.sinh(x), math.cosh(x), math.sinh(x))
    if op == COSH:
        return chain(u, math.cosh(x), math.sinh(x), math.cosh(x))
    if op == TANH:
        t = math.tanh(x)
        return chain(u, t, 1.0 - t * t, -2.0 * t * (1.0 - t * t))
    if op == EXP:
        e = math.exp(x)
        return chain(u, e, e, e)
    if op == LOG:
        return chain(u, math.log(x), 1.0 / x, -1.0 / (x * x))
    if op == LOG10:
        return chain(u, math.log10(x), 1.0 / (LN10 * x), -1.0 / (LN10 * x * x))
    if op == SQRT:
        return root(u)
    if op == AINT:
        return constant(towards_zero(x))
    # ANINT: the nearest whole number, halves away from 0
    return constant(math.copysign(towards_zero(abs(x) + 0.5), x))


@jitable
def of_two(op: int, u: V3, v: V3) -> V3:
    """Return a function of two jets."""
    if op == ADD:
        return add(u, v)
    if op == SUB:
        return sub(u, v)
    if op == MUL:
        return times(u, v)
    if op == DIV:
        return over(u, v)
    if op == POW:
        return power(u, v)
    if op == ATAN2:
        return arc_tangent2(u, v)
    if op == MOD:
        # u - v AINT(u / v): the sign is that of u
        return sub(u, scale(towards_zero(u[0] / v[0]), v))
    if op == SIGN:
        size = absolute(u)
        return size if v[0] >= 0.0 else scale(-1.0, size)
    # DIM: how much u is above v
    return sub(u, v) if u[0] > v[0] else constant(0.0)


@jitable
def of_many(op: int, stack: F2, at: int, count: int) -> V3:
    """Return a function of `count` jets that stand from row `at` on."""
    if op == MIN:
        return extreme(stack, at, count, -1.0)
    if op == MAX:
        return extreme(stack, at, count, 1.0)
    if op == POLY:
        return polynomial(stack, at, count)
    if op == CHEBY:
        return chebyshev(stack, at, count)
    if op == FORSIN:
        return fourier(stack, at, count, True)
    if op == FORCOS:
        return fourier(stack, at, count, False)
    if op == SHF:
        return harmonic(stack, at, count)
    if op == BISTOP:
        return two_stops(stack, at)
    if op == SWEEP:
        return chirp(stack, at)
    a, b, c = get(stack, at), get(stack, at + 1), get(stack, at + 2)
    d = get(stack, at + 3)
    if op == IF:
        return b if a[0] < 0.0 else (c if a[0] == 0.0 else d)
    e = get(stack, at + 4)
    if op == STEP:
        return blend(a, b, c, d, e, False)
    if op == STEP5:
        return blend(a, b, c, d, e, True)
    if op == HAVSIN:
        return haversine(a, b, c, d, e)
    # IMPACT(x, x', x1, k, e, c, d): depth x1 - x
    return stop(sub(c, a), scale(-1.0, b), d, e, get(stack, at + 5), get(stack, at + 6))


@jitable
def apply(op: int, count: int, stack: F2, top: int) -> int:
    """Replace the `count` topmost of `top` jets by a function of them; return the new top."""
    at = top - count
    if op == MIN or op == MAX or count > 2:
        put(stack, at, of_many(op, stack, at, count))
    elif count == 1:
        put(stack, at, of_one(op, get(stack, at)))
    else:
        put(stack, at, of_two(op, get(stack, at), get(stack, at + 1)))
    return at + 1

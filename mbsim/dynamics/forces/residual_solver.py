"""The unknowns z that make the residual of a Force_Element 0: `force_element` says what they are.

By Newton's method with differences; where that fails, one unknown is bracketed, several go on with
shortened steps. A residual is to be continuous, switches do no harm.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import PYTHON_CALLS, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.model import Residuals
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import AT_ONCE, Code
from mbsim.core.jitable import jitable
from mbsim.laws.residual import ALGEBRAIC, DIFFERENTIAL, SWITCHING

#: Steps of Newton's method, then shortened ones, then of bracketing.
MOST_STEPS, MOST_SHORT, MOST_HALVES = 20, 60, 200
#: A correction that ends the iteration, as a part of what is corrected and of its scale; rounding.
SMALL, ROUNDING = 1e-11, 4e-16
#: What is left of a residual, as a part of what it was at first, and counts as 0.
ZERO = 1e-13
#: Differences, as a part of what is changed and of its scale.
PART = 1e-7
#: A pivot below this part of its column, scaled, is none.
SINGULAR_BELOW = 1e-13


@jitable
def axes_of(scene: Scene, e: int) -> int:
    """Return how many directions element e has."""
    return scene.residuals.first[e + 1] - scene.residuals.first[e]


@jitable
def unknowns_of(scene: Scene, e: int) -> int:
    """Return how many unknowns element e has."""
    return scene.residuals.begin[e + 1] - scene.residuals.begin[e]


@jitable
def own_time(scene: Scene) -> float:
    """Return L/V."""
    return scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]


@jitable
def ask(scene: Scene, e: int) -> int:
    """Fill `out` with the residual of what is given; return a code."""
    R = scene.residuals
    if R.interpreted[e] == 1:
        scene.log.counters[PYTHON_CALLS] += 1
    code = call_int(R.address[e], (R.id[e], R.given, R.par[e], R.out))
    total = 0.0
    for k in range(unknowns_of(scene, e)):
        total += R.out[k]
    if (code != 0 or not math.isfinite(total)) and R.interpreted[e] == 0:
        # the interpreted one says what is wrong
        return call_int(R.twin[e], (R.id[e], R.given, R.par[e], R.out))
    return code


@jitable
def put_unknowns(scene: Scene, e: int, h: float) -> None:
    """Write f and f' that follow from z into `given`; `base` holds what f begins at."""
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    first = 1 + 2 * na
    for k in range(nu):
        kind = R.kind[R.begin[e] + k]
        z = R.z[k]
        if kind == ALGEBRAIC:
            R.given[first + k], R.given[first + nu + k] = z, 0.0
        else:
            R.given[first + k] = R.base[k] + (h * z if kind == SWITCHING else 0.0)
            R.given[first + nu + k] = z


@jitable
def ask_at(scene: Scene, e: int, h: float) -> int:
    """Fill `out` with the residual of z; return a code."""
    put_unknowns(scene, e, h)
    return ask(scene, e)


@jitable
def difference(scene: Scene, e: int, at: int, size: float, column: F1) -> int:
    """Fill a column with the residual by one argument, where r is in `rows`; return a code."""
    R = scene.residuals
    kept = R.given[at]
    R.given[at] = kept + size
    size = R.given[at] - kept
    code = ask(scene, e)
    R.given[at] = kept
    for k in range(unknowns_of(scene, e)):
        column[k] = (R.out[k] - R.rows[k]) / size
    return code


@jitable
def find_slopes(scene: Scene, e: int, every: bool) -> int:
    """Fill `by` with the residual by f and f', where r is in `rows`; return a code.

    What r is not solved for is left out unless `every` one is wanted.
    """
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    first, rate = 1 + 2 * na, 1.0 / own_time(scene)
    for k in range(nu):
        kind, scale = R.kind[R.begin[e] + k], R.scale[R.begin[e] + k]
        for part in range(2):
            column = R.by[part, k]
            wanted = every or kind != (DIFFERENTIAL if part == 0 else ALGEBRAIC)
            for i in range(nu):
                column[i] = 0.0
            if wanted:
                at = first + part * nu + k
                size = PART * (abs(R.given[at]) + scale * (1.0 if part == 0 else rate))
                code = difference(scene, e, at, size, column)
                if code != 0:
                    return code
    return 0


@jitable
def fill_matrix(scene: Scene, e: int, h: float) -> None:
    """Fill A with the residual by z."""
    R, nu = scene.residuals, unknowns_of(scene, e)
    for k in range(nu):
        kind = R.kind[R.begin[e] + k]
        for i in range(nu):
            by_f, by_rate = R.by[0, k, i], R.by[1, k, i]
            if kind == ALGEBRAIC:
                R.A[i, k] = by_f
            elif kind == DIFFERENTIAL:
                R.A[i, k] = by_rate
            else:
                R.A[i, k] = by_rate + h * by_f


@jitable
def factor(R: Residuals, nu: int) -> bool:
    """Factor A in place, rows and columns scaled to 1; return whether that can be done."""
    for k in range(nu):
        largest = 0.0
        for i in range(nu):
            largest = max(largest, abs(R.A[i, k]))
        if largest == 0.0 or not math.isfinite(largest):
            return False
        R.size[k] = largest
        for i in range(nu):
            R.A[i, k] /= largest
    for k in range(nu):
        best = k
        for i in range(k + 1, nu):
            if abs(R.A[i, k]) > abs(R.A[best, k]):
                best = i
        R.swap[k] = best
        for j in range(nu):
            R.A[k, j], R.A[best, j] = R.A[best, j], R.A[k, j]
        if abs(R.A[k, k]) < SINGULAR_BELOW:
            return False
        for i in range(k + 1, nu):
            R.A[i, k] /= R.A[k, k]
            for j in range(k + 1, nu):
                R.A[i, j] -= R.A[i, k] * R.A[k, j]
    return True


@jitable
def back(R: Residuals, nu: int, b: F1) -> None:
    """Solve A x = b in place, A as `factor` left it."""
    for k in range(nu):
        # rows were swapped as a whole, their factors too
        b[k], b[R.swap[k]] = b[R.swap[k]], b[k]
    for k in range(nu):
        for i in range(k + 1, nu):
            b[i] -= R.A[i, k] * b[k]
    for k in range(nu - 1, -1, -1):
        for j in range(k + 1, nu):
            b[k] -= R.A[k, j] * b[j]
        b[k] /= R.A[k, k]
    for k in range(nu):
        b[k] /= R.size[k]


@jitable
def scale_of(scene: Scene, e: int, k: int, h: float) -> float:
    """Return a usual size of what is sought of unknown k."""
    R = scene.residuals
    u = R.begin[e] + k
    if R.kind[u] == ALGEBRAIC:
        return R.scale[u]
    # over a long step a small rate makes a difference
    return R.scale[u] / (max(h, own_time(scene)) if R.kind[u] == SWITCHING else own_time(scene))


@jitable
def is_small(scene: Scene, e: int, h: float) -> bool:
    """Return whether the step is one that ends the iteration."""
    R, worst = scene.residuals, 0.0
    for k in range(unknowns_of(scene, e)):
        worst = max(worst, abs(R.step[k]) / (abs(R.z[k]) + scale_of(scene, e, k, h)))
    return worst <= SMALL


@jitable
def is_naught(scene: Scene, e: int) -> bool:
    """Return whether the residual is 0 to the last digit."""
    for k in range(unknowns_of(scene, e)):
        if scene.residuals.out[k] != 0.0:
            return False
    return True


@jitable
def take_step(scene: Scene, e: int) -> None:
    """Let the step be -A^-1 r."""
    R, nu = scene.residuals, unknowns_of(scene, e)
    for k in range(nu):
        R.step[k] = -R.out[k]
    back(R, nu, R.step)


@jitable
def slopes_here(scene: Scene, e: int, h: float) -> int:
    """Factor the residual by z, where r is in `out`; return a code, -1 if singular."""
    R, nu = scene.residuals, unknowns_of(scene, e)
    for k in range(nu):
        R.rows[k] = R.out[k]
    code = find_slopes(scene, e, False)
    if code != 0:
        return code
    for k in range(nu):
        R.out[k] = R.rows[k]
    fill_matrix(scene, e, h)
    return 0 if factor(R, nu) else -1


@jitable
def largest(R: Residuals, nu: int) -> float:
    """Return the largest number of the residual."""
    most = 0.0
    for k in range(nu):
        most = max(most, abs(R.out[k]))
    return most


@jitable
def newton(scene: Scene, e: int, h: float) -> int:
    """Find z by Newton's method from where it is; return 0, -1 where it fails, or a code.

    -2: corrections are small, but the residual is not: differences reach over a switch.
    """
    R, nu = scene.residuals, unknowns_of(scene, e)
    code = ask_at(scene, e, h)
    if code != 0 or is_naught(scene, e):
        return code
    at_first = largest(R, nu)
    for _ in range(MOST_STEPS):
        code = slopes_here(scene, e, h)
        if code != 0:
            return code
        take_step(scene, e)
        for k in range(nu):
            R.z[k] += R.step[k]
        code = ask_at(scene, e, h)
        shorter = 0
        while code != 0 and code < AT_ONCE and shorter < 10:
            # a trial value may be one for which the residual was not written
            shorter += 1
            for k in range(nu):
                R.step[k] *= 0.5
                R.z[k] -= R.step[k]
            code = ask_at(scene, e, h)
        if code != 0:
            return code
        if is_naught(scene, e):
            return 0
        take_step(scene, e)
        if is_small(scene, e, h):
            before = largest(R, nu)
            for k in range(nu):
                R.z[k] += R.step[k]
            code = ask_at(scene, e, h)
            good = largest(R, nu) <= max(0.1 * before, ZERO * at_first)
            return code if code != 0 or good else -2
    return -1


@jitable
def bracket(scene: Scene, e: int, h: float) -> int:
    """Find an only unknown between values where r has two signs; return what `newton` does."""
    R = scene.residuals
    z0, size = R.start[0], scale_of(scene, e, 0, h)
    R.z[0] = z0
    code = ask_at(scene, e, h)
    if code != 0:
        return code
    at, found = R.out[0], False
    low, high, r_low, r_high = z0, z0, at, at
    for k in range(MOST_SHORT):
        reach = size * 1e-6 * 4.0**k
        for side in range(2):
            z = z0 + reach if side == 0 else z0 - reach
            R.z[0] = z
            if ask_at(scene, e, h) != 0:
                continue
            if R.out[0] * at <= 0.0:
                low, r_low, high, r_high, found = z0, at, z, R.out[0], True
                break
        if found:
            break
    if not found:
        return -1
    for k in range(MOST_HALVES):
        # regula falsi finds the piece of a law that is straight in one go, halves do the rest
        z = 0.5 * (low + high)
        if k % 3 != 0 and r_high != r_low:
            straight = high - r_high * (high - low) / (r_high - r_low)
            if min(low, high) < straight < max(low, high):
                z = straight
        R.z[0] = z
        code = ask_at(scene, e, h)
        if code != 0:
            return code
        if R.out[0] == 0.0:
            return 0
        if R.out[0] * r_low > 0.0:
            low, r_low = z, R.out[0]
        else:
            high, r_high = z, R.out[0]
        if abs(high - low) <= ROUNDING * (abs(z) + size):
            # a jump from one sign to the other is no root
            tiny = 1e-6 * abs(at)
            return 0 if min(abs(r_low), abs(r_high)) <= tiny or at == 0.0 else -1
    return 0


@jitable
def go_down(scene: Scene, e: int, h: float) -> int:
    """Find several unknowns by steps that make r smaller; return what `newton` does."""
    R, nu = scene.residuals, unknowns_of(scene, e)
    for k in range(nu):
        R.z[k] = R.start[k]
    code = ask_at(scene, e, h)
    for _ in range(MOST_SHORT):
        if code != 0:
            return code
        code = slopes_here(scene, e, h)
        if code != 0:
            return code
        take_step(scene, e)
        if is_small(scene, e, h):
            for k in range(nu):
                R.z[k] += R.step[k]
            return 0
        before, part = 0.0, 1.0
        for k in range(nu):
            before += R.rows[k] ** 2
        while True:
            for k in range(nu):
                R.z[k] += part * R.step[k]
            code = ask_at(scene, e, h)
            after = 0.0
            for k in range(nu):
                after += R.out[k] ** 2
            if (code == 0 and after < (1.0 - 1e-4 * part) * before) or code >= AT_ONCE:
                break
            for k in range(nu):
                R.z[k] -= part * R.step[k]
            part *= 0.5
            if part < 1e-8:
                return -1
        if code == 0 and is_naught(scene, e):
            return 0
    return -1


@jitable
def solve(scene: Scene, e: int, h: float) -> int:
    """Find z that makes the residual 0, from `start`; return 0 or a code."""
    R, nu = scene.residuals, unknowns_of(scene, e)
    for k in range(nu):
        R.z[k] = R.start[k]
    code = newton(scene, e, h)
    found = R.z[0]
    if code == -1:
        code = bracket(scene, e, h) if nu == 1 else go_down(scene, e, h)
    elif code == -2:
        # nothing better may be found: what is left is then rounding
        if nu > 1 or bracket(scene, e, h) != 0:
            R.z[0] = found
        code = 0
    if code == -1:
        R.unsolved[0] = e
        return Code.UNSOLVED_ELEMENT
    if code == 0:
        put_unknowns(scene, e, h)
    return code

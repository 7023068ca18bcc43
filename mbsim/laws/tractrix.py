"""The direction of a spring that is dragged along a plane way: a tractrix.

A spring of length rho whose end moves at v turns with its unit vector e as

    e' = (v - (v.e) e)/rho = w - (w.e) e,  w = M' = v/rho

With complex numbers that is Riccati's equation e' = (w - conj(w) e^2)/2, so e = p/q with

    (p, q)' = A (p, q),   A = 1/2 [[0, w], [conj(w), 0]]

For a w that keeps its direction the angle between e and w has tan(a/2) = tan(a0/2) exp(-|M|).
For one that turns the exponential of Magnus' series of order 4 is taken piece by piece of M: pieces
of PIECE at the end, every FEW of them twice as long as those behind them, for what is wrong
fades as exp(-|M|). What lies farther back is forgotten.
Source: S. Blanes, F. Casas, J. A. Oteo, J. Ros, Physics Reports 470 (2009) 151-238, section 5.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2
from mbsim.core.jitable import jitable

#: The shortest piece, how many are of one length, and how many there are at most.
PIECE, FEW, MOST = 0.125, 4, 24
#: A spring that is pushed back by more of its length in a piece would come round, in a way that
#: rounding decides. What slips so sticks before: it stays, and whoever asks sees it goes back.
BACK = 0.5
#: Half the distance of Gauss' two points, and the factor of the commutator: sqrt(3)/24.
_GAUSS, _COMMUTATOR = 0.28867513459481287, 0.07216878364870322
#: A way whose directions differ by less is straight.
STRAIGHT = 1e-15


@jitable
def dragged(
    ex: float, ey: float, ax: float, ay: float, mx: float, my: float, bx: float, by: float
) -> V2:
    """Return the direction of the spring behind a way.

    Parameters
    ----------
    ex, ey : float
        Unit vector at the way's begin; zero: none yet.
    ax, ay : float
        Rate of the way at its begin, times the time that it takes.
    mx, my : float
        The way M, in lengths of the spring: a cubic with these rates at its ends.
    bx, by : float
        Rate at its end.

    Returns
    -------
    float, float
    """
    # the rate in the middle
    cx, cy = 1.5 * mx - 0.25 * (ax + bx), 1.5 * my - 0.25 * (ay + by)
    size_a, size_b, size_c = math.hypot(ax, ay), math.hypot(bx, by), math.hypot(cx, cy)
    way = (size_a + 4.0 * size_c + size_b) / 6.0
    if ex == 0.0 and ey == 0.0:
        if size_b == 0.0:
            return 0.0, 0.0
        return bx / size_b, by / size_b
    across = abs(ex * ay - ey * ax) + abs(ex * my - ey * mx) + abs(ex * by - ey * bx)
    if across <= STRAIGHT * way:
        return ex, ey
    n, back = 0, 0.0
    while n < MOST and back < way:
        n += 1
        back = PIECE * 2.0 ** (n // FEW) * (FEW + n % FEW) - PIECE * FEW
    s = 0.0
    if back < way:
        s = 1.0 - back / way
    for i in range(n - 1, -1, -1):
        end = 1.0 - (PIECE * 2.0 ** (i // FEW) * (FEW + i % FEW) - PIECE * FEW) / way
        h = end - s
        # w at Gauss' points
        p = s + h * (0.5 - _GAUSS)
        ka, km, kb = 1.0 - p * (4.0 - 3.0 * p), 6.0 * p * (1.0 - p), p * (3.0 * p - 2.0)
        ux, uy = ka * ax + km * mx + kb * bx, ka * ay + km * my + kb * by
        p = s + h * (0.5 + _GAUSS)
        ka, km, kb = 1.0 - p * (4.0 - 3.0 * p), 6.0 * p * (1.0 - p), p * (3.0 * p - 2.0)
        vx, vy = ka * ax + km * mx + kb * bx, ka * ay + km * my + kb * by
        if 0.5 * h * (ex * (ux + vx) + ey * (uy + vy)) < -BACK:
            return ex, ey
        # the exponential of [[i alpha, beta], [conj(beta), -i alpha]], over its cosine
        beta_x, beta_y = 0.25 * h * (ux + vx), 0.25 * h * (uy + vy)
        alpha = _COMMUTATOR * h * h * (ux * vy - uy * vx)
        square = beta_x * beta_x + beta_y * beta_y - alpha * alpha
        part = 1.0 - square / 3.0
        if square > 1e-6:
            part = math.tanh(math.sqrt(square)) / math.sqrt(square)
        elif square < -1e-6:
            part = math.tan(math.sqrt(-square)) / math.sqrt(-square)
        turn = alpha * part
        top_x = ex - turn * ey + part * beta_x
        top_y = ey + turn * ex + part * beta_y
        low_x = 1.0 + part * (beta_x * ex + beta_y * ey)
        low_y = part * (beta_x * ey - beta_y * ex) - turn
        ex, ey = top_x * low_x + top_y * low_y, top_y * low_x - top_x * low_y
        size = math.hypot(ex, ey)
        if size == 0.0:
            # against the way to the last digit: it comes round
            ex, ey, size = ux + vx, uy + vy, math.hypot(ux + vx, uy + vy)
        ex, ey = ex / size, ey / size
        s = end
    return ex, ey

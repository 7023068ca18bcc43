"""Equations that are a user's relation of their terms, such as COUPLER by COUSUB.

With d the terms, G their gradients and g(d) the relation, g_k and g_kl its derivatives:

    g' = g_k d_k',   g'' = g_k d_k'' + g_kl d_k' d_l',   gradient: g_k G_k.

A subroutine stands behind (scene, t, y, results) -> code. It finds d in `results`, and behind them
the size by which it may take differences, and leaves g, g_k and g_kl there.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    OFFSET,
    PAIR_RATE,
    PAIR_SECOND,
    PAIR_VALUE,
    PYTHON_CALLS,
    RELATION_SLOPES,
    RELATION_VALUE,
    SCALE_LENGTH,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable


@jitable
def relate(scene: Scene, t: float, y: F1, e: int) -> int:
    """Put value, rate and second rate into `Sweep.pair`, scale gradients; return a code.

    Terms are as they are, in `Sweep.related`, and their gradients in `Sweep.G`.
    """
    eq, sweep, users = scene.equations, scene.sweep, scene.users
    first, row = eq.first[e], eq.user[e] - 1
    n, result, terms, pair = eq.first[e + 1] - first, users.result[row], sweep.related, sweep.pair
    for k in range(n):
        lengths = eq.kind[first + k] == OFFSET
        result[k] = terms[k, PAIR_VALUE]
        result[n + k] = scene.world.scale[SCALE_LENGTH] if lengths else 1.0
    scene.log.counters[PYTHON_CALLS] += 1
    code = call_int(users.address[row], (scene, t, y, result))
    if code != 0:
        pair[PAIR_VALUE] = pair[PAIR_RATE] = pair[PAIR_SECOND] = math.nan
        return code
    pair[PAIR_VALUE], pair[PAIR_RATE], pair[PAIR_SECOND] = result[RELATION_VALUE], 0.0, 0.0
    for k in range(n):
        slope = result[RELATION_SLOPES + k]
        pair[PAIR_RATE] += slope * terms[k, PAIR_RATE]
        pair[PAIR_SECOND] += slope * terms[k, PAIR_SECOND]
        for m in range(n):
            bend = result[RELATION_SLOPES + n + n * k + m]
            pair[PAIR_SECOND] += bend * terms[k, PAIR_RATE] * terms[m, PAIR_RATE]
        for c in range(12):
            sweep.G[first + k, c] *= slope
    return 0

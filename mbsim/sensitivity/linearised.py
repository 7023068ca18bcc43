"""A linearisation of the twin's own, where that of the run is no good for derivatives.

A run keeps a linearisation from step to step while its own iteration converges with it. What a
derivative is made of may be what the run hardly moves, as a spring of friction that has stuck
since: there forces are others by now, and the iteration for it would not converge. So the twin is
linearised in the step itself, once for all parameters, in arrays of its own: the run's stay as they
are.
"""

from __future__ import annotations

from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.integrators.radau5 import G0, G_IM, G_RE
from mbsim.integrators.scheme import JACOBIAN_TIME, Method, in_workspace
from mbsim.sensitivity.arrays import (
    LINEARISED,
    OWN_TANGENT,
    RUN_TANGENT,
    TWIN,
    UP,
    Variations,
)


@jitable
def begin_step(V: Variations, m: Method, t: float) -> bool:
    """Begin a step from t; return whether a parameter takes the twin's own linearisation there.

    It does no more where the run has linearised since.
    """
    V.words[LINEARISED], own = 0, False
    for k in range(len(V.stale)):
        if m.memory[JACOBIAN_TIME] >= t:
            V.stale[k] = 0
        own = own or V.stale[k] == 1
    return own


@jitable
def take_systems(V: Variations, k: int) -> None:
    """Let linear systems be the twin's own where parameter k takes these, else the run's.

    So it makes no difference to a parameter what others there are.
    """
    own = V.words[OWN_TANGENT] if V.stale[k] == 1 else V.words[RUN_TANGENT]
    view(V.words[TWIN], Scene).world.hooks[Hook.TANGENT] = own


@jitable
def linearise(V: Variations, t: float, h: float, late: float, y: F1, f: F1, c: F1) -> int:
    """Linearise the twin at y, `late` after t, where f has just been evaluated, for a step h.

    Return 0 or NOT_CONVERGED. The numbers of c, seven or more, are overwritten.
    """
    twin, p = view(V.words[TWIN], Scene), in_workspace(V.words[UP])[0]
    twin.world.hooks[Hook.TANGENT] = V.words[OWN_TANGENT]
    V.words[LINEARISED] = 1
    code = call_int(p.linearise, (p.context, t + late, late, y, f))
    g, re, im = G0 / h, G_RE / h, G_IM / h
    c[0], c[1], c[2], c[3] = g, g * g, g, 0.0
    code = code or call_int(p.factor, (p.context, t, h, c, c))
    c[0], c[1], c[2], c[3] = re, im, re * re - im * im, 2.0 * re * im
    c[4], c[5], c[6] = re, im, 0.0
    code = code or call_int(p.factor_pair, (p.context, t, h, c, c))
    if code != 0:
        code = Code.NOT_CONVERGED
    return code

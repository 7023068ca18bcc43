"""The hook of many loops, which only scenes that have them compile."""

from __future__ import annotations

from mbsim.arrays.hooks import Loops
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import Pointer
from mbsim.dynamics.loops.least_reactions import fill_links, relieve
from mbsim.dynamics.loops.multipliers import factor_loops, solve_loops, weigh


def serve_loops(context: int, what: int, t: float, y: Pointer) -> int:
    """All that many loops are asked for."""
    scene = view(context, Scene)
    if what == Loops.WEIGH:
        weigh(scene)
    elif what == Loops.FACTOR:
        factor_loops(scene, t)
    elif what == Loops.SOLVE:
        solve_loops(scene)
    elif what == Loops.STRESS:
        fill_links(scene, vector_at(y, scene.rows.y.shape[1]))
    else:
        relieve(scene)
    return 0

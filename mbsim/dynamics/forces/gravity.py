"""Weight by an acceleration that is given over time."""

from __future__ import annotations

from mbsim.arrays.codes import OF_DAMPERS
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.expressions.jets import value


@jitable
def add_weight(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Add m g(t) to every body, and its work, with the sign turned, to what is lost; return 0.

    Only of the components that are expressions: the constant ones have a potential.
    """
    bodies, work, lost = scene.bodies, scene.work, 0.0
    for k in range(3):
        program = scene.world.weight[0, k]
        if program < 0:
            continue
        g = value(scene, t, y, program)
        for b in range(len(bodies.mass)):
            work.force[b, k] += bodies.mass[b] * g
            lost -= bodies.mass[b] * g * work.v[b, k]
    dy[scene.world.accumulators[OF_DAMPERS]] += lost
    return 0

"""By which speed errors of connected bodies are judged: their weight's, or the largest so far.

With V0 the group's least speed (`compile_model.groups`) and L its length, V = max(V0, sqrt(g L))
under weight. Without it nothing tells beforehand how fast a group will be that rests until it is
pushed: V is then at least PART of the largest speed that one of its bodies has had, and has where
an error is judged.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import norm, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake

#: Of the largest speed so far: what moves fast for a moment is judged by less for long.
PART = 0.1


@jitable
def take_speeds(scene: Scene, y: F1, speeds: F1) -> None:
    """Raise PART of the speeds (groups,) to that of the bodies at y: of the cg, and of turning."""
    scales = scene.scales
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        at, g = BODY_SIZE * b, scales.group[b]
        speed = norm((y[at + 7], y[at + 8], y[at + 9]))
        speed += scales.gyration[b] * norm((y[at + 10], y[at + 11], y[at + 12]))
        # what is no number is no speed, and no error either
        if PART * speed > speeds[g]:
            speeds[g] = PART * speed


@jitable
def fill_squares(scene: Scene, y: F1) -> None:
    """Fill V^2 of all groups for an error at y."""
    scales, squares = scene.scales, scene.work.squares
    g = norm(vector(scene.world.gravity))
    if g == 0.0:
        for k in range(len(squares)):
            squares[k] = max(scales.speed[k], scene.state.fastest[k])
        take_speeds(scene, y, squares)
        for k in range(len(squares)):
            squares[k] *= squares[k]
    else:
        for k in range(len(squares)):
            squares[k] = max(scales.speed[k] ** 2, g * scales.length[k])

"""What a step goes through: everything, or what does not sleep (`stepping.awake`)."""

from __future__ import annotations

from mbsim.arrays.codes import AWAKE_BODIES, AWAKE_GRAPHICS
from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.problem import GOES, LISTED


@jitable
def bodies_awake(scene: Scene) -> int:
    """Return how many bodies there are to go through."""
    awake = scene.awake
    return awake.count[AWAKE_BODIES] if awake.whole[GOES] == LISTED else len(scene.bodies.mass)


@jitable
def body_awake(scene: Scene, k: int) -> int:
    """Return the k-th of them."""
    return scene.awake.body[k] if scene.awake.whole[GOES] == LISTED else k


@jitable
def graphics_awake(scene: Scene) -> int:
    """Return how many graphics there are to go through, those of ground among them or not."""
    awake = scene.awake
    return awake.count[AWAKE_GRAPHICS] if awake.whole[GOES] == LISTED else len(scene.graphics.body)


@jitable
def graphic_awake(scene: Scene, k: int) -> int:
    """Return the k-th of them."""
    return scene.awake.graphic[k] if scene.awake.whole[GOES] == LISTED else k

"""Which constraint equations are in use."""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable


@jitable
def active_count(scene: Scene) -> int:
    """Return the number of equations in use."""
    active = scene.equations.active
    return active[len(active) - 1]


@jitable
def is_active(scene: Scene, e: int) -> bool:
    """Return whether equation e is in use."""
    # those in use ascend
    active, first, end = scene.equations.active, 0, active_count(scene)
    while first < end:
        middle = (first + end) // 2
        if active[middle] < e:
            first = middle + 1
        else:
            end = middle
    return first < active_count(scene) and active[first] == e


@jitable
def is_off(scene: Scene, e: int) -> bool:
    """Return whether the element of equation e takes no part now."""
    return scene.equations.off[e] == 1


@jitable
def is_friction(scene: Scene, e: int) -> bool:
    """Return whether equation e is of friction: it holds only while that sticks."""
    return scene.equations.dry[e] >= 0 or scene.equations.slot[e] >= 0

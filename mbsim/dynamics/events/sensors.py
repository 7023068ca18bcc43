"""What sensors see: whether a condition has become true since the committed state.

With e the expression less the value and w the width, a sensor is on where

| compare  | e        |
|----------|----------|
| NOT_LESS | >= -w    |
| NOT_MORE | <= w     |
| MORE     | > -w     |
| LESS     | < w      |
| EQUAL    | in -w..w, or of another sign than at the committed state |

and it acts where it is on and was not. A located EQUAL acts wherever e comes to 0 or changes sign.
"""

from __future__ import annotations

from mbsim.arrays.codes import (
    EQUAL,
    EVENT_ELEMENT,
    EVENT_KIND,
    EVENT_SLOT,
    EVENT_TIME,
    EXCESS,
    FIRED,
    LESS,
    MORE,
    NEXT,
    NOT_LESS,
    NOT_MORE,
    ON,
    SENSOR,
    USED_EVENTS,
)
from mbsim.arrays.hooks import failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.expressions.jets import value

#: Stands for the side to which an expression left its value.
LEAST = 1e-300


@jitable
def opposite(a: float, b: float) -> bool:
    """Return whether one is above 0 and the other below."""
    return (a < 0.0 < b) or (b < 0.0 < a)


@jitable
def is_on(scene: Scene, k: int, excess: float) -> bool:
    """Return whether the condition of sensor k holds."""
    compare, width = scene.sensors.compare[k], scene.sensors.width[k]
    if compare == NOT_LESS:
        return excess >= -width
    if compare == NOT_MORE:
        return excess <= width
    if compare == MORE:
        return excess > -width
    if compare == LESS:
        return excess < width
    return abs(excess) <= width or opposite(excess, scene.state.sensed[k, EXCESS])


@jitable
def becomes_true(scene: Scene, k: int, excess: float) -> bool:
    """Return whether sensor k acts where the expression exceeds the value by `excess`."""
    before = scene.state.sensed[k, EXCESS]
    if scene.sensors.compare[k] == EQUAL and scene.sensors.located[k] == 1:
        return opposite(excess, before) or (excess == 0.0 and before != 0.0)
    return is_on(scene, k, excess) and scene.state.sensed[k, ON] == 0.0


@jitable
def happens(scene: Scene, t: float, y: F1) -> int:
    """Return 1 if a located sensor has become true by (t, y), else 0."""
    place_bodies(scene, y)
    sensors = scene.sensors
    for k in range(len(sensors.id)):
        if sensors.located[k] == 1:
            excess = value(scene, t, y, sensors.program[k]) - sensors.value[k]
            if becomes_true(scene, k, excess):
                return 1
            if scene.state.sensed[k, EXCESS] == 0.0 and excess != 0.0:
                # it left the value to this side: without that a return within the step is not seen
                scene.state.sensed[k, EXCESS] = LEAST if excess > 0.0 else -LEAST
    return 0


@jitable
def arrive(scene: Scene, t: float, y: F1) -> int:
    """Note what every sensor sees at the committed state; return 1 if one has become true."""
    place_bodies(scene, y)
    sensors, sensed, rows, any_fired = scene.sensors, scene.state.sensed, scene.rows, 0
    for k in range(len(sensors.id)):
        excess = value(scene, t, y, sensors.program[k]) - sensors.value[k]
        fires = becomes_true(scene, k, excess)
        sensed[k, ON] = 1.0 if is_on(scene, k, excess) else 0.0
        sensed[k, EXCESS] = excess
        if not fires:
            continue
        any_fired = 1
        sensed[k, FIRED] = 1.0
        if sensors.evaluate[k] >= 0:
            sensed[k, NEXT] = value(scene, t, y, sensors.evaluate[k])
        at = rows.used[USED_EVENTS]
        rows.events[at, EVENT_TIME], rows.events[at, EVENT_KIND] = t, SENSOR
        rows.events[at, EVENT_ELEMENT], rows.events[at, EVENT_SLOT] = sensors.id[k], -1.0
        rows.used[USED_EVENTS] = at + 1
    return any_fired


def happens_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Whether a located sensor has become true."""
    scene = view(context, Scene)
    answer = happens(scene, t, vector_at(a, scene.rows.y.shape[1]))
    code = failure_or(scene, 0)
    return answer if code == 0 else -code


def arrive_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """What sensors see at a committed state."""
    scene = view(context, Scene)
    answer = arrive(scene, t, vector_at(a, scene.rows.y.shape[1]))
    code = failure_or(scene, 0)
    return answer if code == 0 else -code

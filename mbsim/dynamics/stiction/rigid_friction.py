"""Rigid friction: what sticks is held, exactly, by an equation; what slides is not.

While it sticks, x' = 0 is an equation in use like that of a motion of velocities, and its
multiplier is the friction force. Where that passes the limit the step ends, the equation goes out
of use and f is a force of that size against the slip; where x' comes back to 0 the step ends too,
the equation is taken into use, and goes out again at once where the force that it would need is
above the limit. Integrators begin anew there, for accelerations jump. Contacts have two equations
at each point and do their part behind a hook, `stiction.rigid_contact`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AXIS_TORQUE,
    HELD_OTHERWISE,
    SCALE_LENGTH,
    SCALE_SPEED,
    SLIDER,
    SLIDER_BEFORE,
    SLIDER_STATIC,
    SLIDES,
    SLIDES_BEFORE,
    SLIP,
    STICK,
)
from mbsim.arrays.hooks import Dry, Hook, Joints, Sticking, answer_of, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.markers import marker_axis
from mbsim.dynamics.forces.applied import commit_kept, displacement, record_mode

#: Part of the model's speed that is rounding.
ROUNDING = 1e-13
#: What something else holds counts as at rest below so many times that: assembly leaves it.
AT_REST = 1e4


@jitable
def rigid_mode(force: float, rate: float, slides: float, static: float, rest: float) -> float:
    """Return the mode that a point asks for where k is infinite.

    Parameters
    ----------
    force : float
        f that holds x' at 0; it counts in stick alone.
    rate, slides, static : float
        As of `dry_mode`.
    rest : float
        What x' may be the other way by rounding alone.

    Returns
    -------
    float
    """
    if slides != 0.0:
        return slides if slides * rate >= -rest else 0.0
    return math.copysign(1.0, force) if abs(force) > static else 0.0


@jitable
def rest_of(scene: Scene, f: int) -> float:
    """Return what is no velocity of rigid friction f but rounding."""
    speed, turns = scene.world.scale[SCALE_SPEED], scene.applied.form[f] == AXIS_TORQUE
    return ROUNDING * (speed / scene.world.scale[SCALE_LENGTH] if turns else speed)


@jitable
def holding_force(scene: Scene, f: int) -> float:
    """Return the force against x that holds rigid friction f, no number where it need not."""
    active = scene.equations.active
    for r in range(active[len(active) - 1]):
        if active[r] == scene.applied.equation[f]:
            return -scene.sweep.multiplier[r]
    return math.nan


@jitable
def show_sticking(scene: Scene) -> None:
    """Fill `Work.applied` of rigid frictions that are held; multipliers have been found."""
    active = scene.equations.active
    for r in range(active[len(active) - 1]):
        f = scene.equations.dry[active[r]]
        if f < 0:
            continue
        n, row = marker_axis(scene, scene.applied.axes[f], 2), scene.work.applied[f]
        first = 3 if scene.applied.form[f] == AXIS_TORQUE else 0
        for k in range(3):
            row[first + k] = scene.sweep.multiplier[r] * n[k]


@jitable
def side_of_rigid(scene: Scene, y: F1, f: int) -> float:
    """Return what rigid friction f does from here on: 0 to stick, or the sign of its slip."""
    par, kept = scene.applied.par[f], scene.state.dry[f]
    _, _, rate = displacement(scene, y, f)
    if math.isnan(kept[SLIDER]):
        return 0.0
    force, rest = holding_force(scene, f), rest_of(scene, f)
    if kept[SLIDES] == 0.0 and math.isnan(force):
        # joints or motions hold it, or move it
        return math.copysign(1.0, rate) if abs(rate) > AT_REST * rest else 0.0
    return rigid_mode(force, rate, kept[SLIDES], par[SLIDER_STATIC], rest)


@jitable
def begin_or_go_on(scene: Scene, y: F1, f: int) -> bool:
    """Set the mode of friction f that the point evaluated last asks for; return whether it is new.

    What comes to rest is first taken to stick.
    """
    kept = scene.state.dry[f]
    begins = math.isnan(kept[SLIDER])
    if begins:
        _, _, rate = displacement(scene, y, f)
        slides = math.copysign(1.0, rate) if abs(rate) > AT_REST * rest_of(scene, f) else 0.0
    else:
        slides = side_of_rigid(scene, y, f)
    changed = begins or slides != kept[SLIDES]
    kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], kept[SLIDES]
    kept[SLIDER], kept[SLIDES] = 0.0, slides
    return changed


@jitable
def ask_contacts(scene: Scene, what: int, t: float, y: F1) -> int:
    """Return what contacts answer whose friction is rigid; 0 if there are none, or it fails."""
    hook = scene.world.hooks[Hook.STICKING]
    return answer_of(scene, call_int(hook, (scene, what, t, y))) if hook != 0 else 0


@jitable
def ask_joints(scene: Scene, what: int, t: float, y: F1) -> None:
    """Ask joints for something; a failure is noted."""
    note_failure(scene, call_int(scene.world.hooks[Hook.JOINTS], (scene, what, t, y, y)))


@jitable
def hold_sticking(scene: Scene, t: float, y: F1) -> int:
    """Take the equations of what sticks into use, bring y onto them and evaluate; return a code."""
    ask_joints(scene, Joints.CHOOSE, t, y)
    ask_joints(scene, Joints.PROJECT, t, y)
    return call_int(scene.world.hooks[Hook.EVALUATE], (scene, t, 0.0, y, scene.work.idle))


@jitable
def release(scene: Scene) -> int:
    """Let slide what has just come to rest and needs more than the limit; return how many."""
    count = 0
    for f in range(len(scene.applied.form)):
        kept = scene.state.dry[f]
        if scene.applied.equation[f] < 0 or kept[SLIDES] != 0.0:
            continue
        force = holding_force(scene, f)
        if math.isnan(force):
            continue
        kept[SLIDES] = rigid_mode(force, 0.0, 0.0, scene.applied.par[f, SLIDER_STATIC], 0.0)
        if kept[SLIDES] != 0.0:
            count += 1
    return count


@jitable
def commit_rigid(scene: Scene, t: float, y: F1) -> int:
    """Keep what rigid frictions do at the point evaluated last; return 0 or HELD_OTHERWISE."""
    changed = ask_contacts(scene, Sticking.BEGIN, t, y) == 1
    for f in range(len(scene.applied.form)):
        if scene.applied.equation[f] >= 0 and begin_or_go_on(scene, y, f):
            changed = True
    if not changed:
        ask_contacts(scene, Sticking.RECORD, t, y)
        return 0
    # one more slides each time, so this ends
    code = hold_sticking(scene, t, y)
    while code == 0:
        # contacts are asked for all of theirs at once, under what the rest does
        if release(scene) == 0 and ask_contacts(scene, Sticking.RELEASE, t, y) == 0:
            break
        code = hold_sticking(scene, t, y)
    note_failure(scene, code)
    ask_contacts(scene, Sticking.RECORD, t, y)
    for f in range(len(scene.applied.form)):
        kept = scene.state.dry[f]
        if scene.applied.equation[f] < 0:
            continue
        if math.isnan(kept[SLIDER_BEFORE]):
            # rows at the start show what holds from there on
            kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], kept[SLIDES]
        elif kept[SLIDES] != kept[SLIDES_BEFORE]:
            record_mode(scene, t, STICK if kept[SLIDES] == 0.0 else SLIP, f)
    return HELD_OTHERWISE


@jitable
def hold_again(scene: Scene, t: float, y: F1) -> None:
    """Take into use what holds at the point to be evaluated, where the last step changed that."""
    kept, contacts = scene.state.dry, ask_contacts(scene, Sticking.CHANGED, t, y)
    if contacts == 1:
        ask_joints(scene, Joints.CHOOSE, t, y)
        return
    for f in range(len(scene.applied.form)):
        if scene.applied.equation[f] >= 0 and kept[f, SLIDES] != kept[f, SLIDES_BEFORE]:
            ask_joints(scene, Joints.CHOOSE, t, y)
            return


@jitable
def serve_rigid(scene: Scene, what: int, t: float, y: F1) -> int:
    """Do what dry friction is asked for (`Dry`); return 0, HELD_OTHERWISE, or less a code."""
    if what == Dry.KEEP:
        commit_kept(scene, t, y)
        return commit_rigid(scene, t, y)
    hold_again(scene, t, y)
    return 0

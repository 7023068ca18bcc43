"""Rigid friction: what sticks is held, exactly, by an equation; what slides is not.

While it sticks, x' = 0 is an equation in use like that of a motion of velocities, and its
multiplier is the friction force. Where that passes the limit the step ends, the equation goes out
of use and f is a force of that size against the slip; where x' comes back to 0 the step ends too,
the equation is taken into use, and goes out again at once where the force that it would need is
above the limit. Integrators begin anew there, for accelerations jump. Contacts have two equations
at each point and do their part behind a door, `stiction.rigid_contact`.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import (
    BEGIN_HELD,
    CHANGED_HELD,
    CHOOSE,
    EVALUATE_DOOR,
    HELD_OTHERWISE,
    JOINTS_DOOR,
    KEEP_DRY,
    PROJECT,
    RECORD_HELD,
    RELEASE_HELD,
    RIGID_DOOR,
    SLIDER,
    SLIDER_BEFORE,
    SLIDES,
    SLIDES_BEFORE,
    SLIP,
    STICK,
)
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.dynamics.forces.dry_friction import (
    AT_REST,
    STATIC,
    commit_dry,
    dry_motion,
    holding_force,
    record_dry,
    rest_of,
    side_of_dry,
)
from mbsim.laws.dry import rigid_mode


@jitable
def begin_or_go_on(scene, y, f):
    """Set the mode of friction f that the point evaluated last asks for; return whether it is new.

    What comes to rest is first taken to stick.
    """
    kept = scene.state.dry[f]
    begins = math.isnan(kept[SLIDER])
    if begins:
        _, _, rate = dry_motion(scene, y, f)
        slides = math.copysign(1.0, rate) if abs(rate) > AT_REST * rest_of(scene, f) else 0.0
    else:
        slides = side_of_dry(scene, y, f)
    changed = begins or slides != kept[SLIDES]
    kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], kept[SLIDES]
    kept[SLIDER], kept[SLIDES] = 0.0, slides
    return changed


@jitable
def ask_contacts(scene, what, t, y):
    """Return what contacts answer whose friction is rigid, 0 where there are none."""
    door = scene.world.doors[RIGID_DOOR]
    return call_int(door, (scene, what, t, y)) if door != 0 else 0


@jitable
def hold_sticking(scene, t, y):
    """Take the equations of what sticks into use, bring y onto them and evaluate; return a code."""
    call_int(scene.world.doors[JOINTS_DOOR], (scene, CHOOSE, t, y, y))
    call_int(scene.world.doors[JOINTS_DOOR], (scene, PROJECT, t, y, y))
    return call_int(scene.world.doors[EVALUATE_DOOR], (scene, t, 0.0, y, scene.work.idle))


@jitable
def release(scene):
    """Let slide what has just come to rest and needs more than the limit; return how many."""
    count = 0
    for f in range(len(scene.applied.kind)):
        kept = scene.state.dry[f]
        if scene.applied.equation[f] < 0 or kept[SLIDES] != 0.0:
            continue
        force = holding_force(scene, f)
        if math.isnan(force):
            continue
        kept[SLIDES] = rigid_mode(force, 0.0, 0.0, scene.applied.par[f, STATIC], 0.0)
        if kept[SLIDES] != 0.0:
            count += 1
    return count


@jitable
def commit_rigid(scene, t, y):
    """Keep what rigid frictions do at the point evaluated last; return 0 or HELD_OTHERWISE."""
    changed = ask_contacts(scene, BEGIN_HELD, t, y) == 1
    for f in range(len(scene.applied.kind)):
        if scene.applied.equation[f] >= 0 and begin_or_go_on(scene, y, f):
            changed = True
    if not changed:
        ask_contacts(scene, RECORD_HELD, t, y)
        return 0
    # one more slides each time, so this ends
    while hold_sticking(scene, t, y) == 0:
        # contacts are asked for all of theirs at once, under what the rest does
        if release(scene) == 0 and ask_contacts(scene, RELEASE_HELD, t, y) == 0:
            break
    ask_contacts(scene, RECORD_HELD, t, y)
    for f in range(len(scene.applied.kind)):
        kept = scene.state.dry[f]
        if scene.applied.equation[f] < 0:
            continue
        if math.isnan(kept[SLIDER_BEFORE]):
            # rows at the start show what holds from there on
            kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], kept[SLIDES]
        elif kept[SLIDES] != kept[SLIDES_BEFORE]:
            record_dry(scene, t, STICK if kept[SLIDES] == 0.0 else SLIP, f)
    return HELD_OTHERWISE


@jitable
def hold_again(scene, t, y):
    """Take into use what holds at the point to be evaluated, where the last step changed that."""
    kept, contacts = scene.state.dry, ask_contacts(scene, CHANGED_HELD, t, y)
    if contacts == 1:
        call_int(scene.world.doors[JOINTS_DOOR], (scene, CHOOSE, t, y, y))
        return
    for f in range(len(scene.applied.kind)):
        if scene.applied.equation[f] >= 0 and kept[f, SLIDES] != kept[f, SLIDES_BEFORE]:
            call_int(scene.world.doors[JOINTS_DOOR], (scene, CHOOSE, t, y, y))
            return


@jitable
def serve_rigid(scene, what, t, y):
    """Do what is asked for at the door of dry friction; return 0 or HELD_OTHERWISE."""
    if what == KEEP_DRY:
        commit_dry(scene, t, y)
        return commit_rigid(scene, t, y)
    hold_again(scene, t, y)
    return 0

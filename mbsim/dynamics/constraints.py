"""What joints are asked for, behind one door: accelerations, projection, reactions, assembly."""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.problem import NOT_FINITE
from mbsim.dynamics.choice import choose, fill_size, keep_choice, use_all
from mbsim.dynamics.dry_friction import show_held
from mbsim.dynamics.equations import (
    FLOW,
    active_count,
    fill_matrix,
    hold,
    is_friction,
)
from mbsim.dynamics.projection import (
    displace,
    prepare_equations,
    project,
    push,
    speed_up,
)
from mbsim.dynamics.reactions import fill_reactions
from mbsim.dynamics.seating import carry_all, seat_all
from mbsim.dynamics.tree import prepare, write_accelerations
from mbsim.system.arrays import (
    ACCELERATE,
    ALONG_JOINTS,
    CHOOSE,
    DISPLACE,
    FRICTION_DOOR,
    KEEP,
    MATRIX,
    PROJECT,
    REACT,
    SEAT,
    SPEED_UP,
)


@jitable
def constrain(scene, t, y, dy):
    """Replace the accelerations in y' by those that the constraints leave; return 0 or a code."""
    prepare(scene, y)
    hold(scene, t, y)
    if scene.world.doors[FRICTION_DOOR] != 0:
        # friction follows from reactions, and these from friction
        code = call_int(scene.world.doors[FRICTION_DOOR], (scene, t, y, dy))
        if code != 0:
            return code
    show_held(scene)
    total = write_accelerations(scene, dy)
    ledger = scene.world.ledger[0]
    if ledger >= 0:
        # the work of what moves with time: multiplier times the rate of its equation's sum
        power, sweep = 0.0, scene.sweep
        for r in range(active_count(scene)):
            if is_friction(scene, scene.equations.active[r]):
                continue
            power += sweep.multiplier[r] * sweep.rate[scene.equations.active[r], FLOW]
        dy[ledger] = power
    return 0 if math.isfinite(total) else NOT_FINITE


@jitable
def serve(scene, what, t, y, dy):
    """Do what is asked for at the door of joints; return 0 or a code.

    The last four are for assembly, in Python: residuals and matrix of all equations at y; bodies
    displaced, or sped up, by the multipliers as they stand; the choice of equations.
    """
    if what == ACCELERATE:
        return constrain(scene, t, y, dy)
    if what == SEAT:
        seat_all(scene, y)
        carry_all(scene, y)
    elif what == PROJECT or what == ALONG_JOINTS:
        project(scene, t, y, 1 if what == PROJECT else 2)
    elif what == REACT:
        fill_reactions(scene, t, y)
    elif what == KEEP:
        return keep_choice(scene, t, y)
    elif what == MATRIX:
        use_all(scene, 0)
        prepare_equations(scene, t, y)
        fill_matrix(scene)
        for e in range(active_count(scene)):
            fill_size(scene, e)
    elif what == CHOOSE:
        prepare_equations(scene, t, y)
        choose(scene, t, y)
    elif what == DISPLACE:
        push(scene)
        displace(scene, y)
        seat_all(scene, y)
    elif what == SPEED_UP:
        push(scene)
        speed_up(scene, y)
        carry_all(scene, y)
    return 0

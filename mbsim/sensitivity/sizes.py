"""Usual sizes of what derivatives are made of, and how exact they are to be."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import SCALE_LENGTH, SCALE_SPEED
from mbsim.core.problem import VELOCITY
from mbsim.dynamics.bodies import configuration
from mbsim.sensitivity.twin import STEP, STEP_OF_CONTACTS

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

Array = np.ndarray[Any, Any]
#: The error of a step of a derivative may be this part of it, or so many tol; where friction
#: remembers.
ENOUGH, ENOUGH_TOL, ENOUGH_OF_MEMORY = 1e-9, 10.0, 30.0
#: Those of GALPHA, whose steps are many, over those of others: of a step where bodies collide, and
#: of what an iteration may leave where friction remembers.
ENOUGH_OFTEN, LEFT_OFTEN = 0.3, 0.1
#: What an iteration may leave, over the error of a step; where there are contacts, as when they
#: touch follows from it; of a derivative, where friction remembers: when that sticks and slips
#: follows from depths, which are far smaller than the model.
LEFT, LEFT_OF_CONTACTS, LEFT_OF_MEMORY = 0.3, 0.05, 3e-10
#: What parts of usual steps of differences, of the least ones, and of what depths allow those to
#: one side take; and of usual steps those to both sides along a step.
#: GALPHA takes many short steps, and looks at how D' changes from one to the next. Where friction
#: remembers stiff springs turn rounding of y into forces: more than wider differences are off by.
ONE_SIDED, ONE_SIDED_IN_IMPACTS = (3.0, 1.0, 1.0, 1.0), (1.0, 0.1, 0.3, 1.0)
ONE_SIDED_OFTEN, ONE_SIDED_OFTEN_IN_IMPACTS = (0.1, 0.1, 1.0, 1.0), (1.0, 0.1, 0.1, 1.0)
ONE_SIDED_OF_MEMORY = (100.0, 1.0, 1.0, 30.0)


def _collides(system: System) -> bool:
    """Return whether there are contacts, and no friction that remembers."""
    return bool(system.contact_ids) and system.scene.state.memory.shape[1] == 0


def breaks(system: System) -> Array:
    """Return 1 for each contact whose friction jumps as nothing presses: it has a viscous part."""
    contacts = [system.model.contacts[id] for id in system.contact_ids]
    viscous = [dict(each.friction).get("viscous_coef", 0.0) > 0.0 for each in contacts]
    return np.array(viscous, dtype=np.int64)


def enough(system: System, tol: float, often: bool = False) -> Array:
    """Return what the error of a step may be, and what an iteration may leave.

    Steps are many and short where they are taken `often`.
    """
    if system.scene.state.memory.shape[1]:
        enough = max(ENOUGH, ENOUGH_OF_MEMORY * tol)
        return np.array((enough, LEFT_OF_MEMORY * (LEFT_OFTEN if often else 1.0)))
    enough = max(ENOUGH, ENOUGH_TOL * tol)
    left = enough * (LEFT_OF_CONTACTS if system.contact_ids else LEFT)
    return np.array((enough * (ENOUGH_OFTEN if often and _collides(system) else 1.0), left))


def one_sided(system: System, often: bool = False) -> Array:
    """Return what parts of usual steps of differences those to one side take.

    Steps are many and short where they are taken `often`.
    """
    if system.scene.state.memory.shape[1]:
        return np.array(ONE_SIDED_OF_MEMORY)
    if _collides(system):
        return np.array(ONE_SIDED_OFTEN_IN_IMPACTS if often else ONE_SIDED_IN_IMPACTS)
    return np.array(ONE_SIDED_OFTEN if often and not system.contact_ids else ONE_SIDED)


def steps(system: System, n: int) -> Array:
    """Return half of the step of a difference in usual sizes of every number of y."""
    found = np.full(n, STEP)
    if system.contact_ids:
        kinds = np.array(configuration.kinds(len(system.body_ids), n))
        found[kinds != VELOCITY] = STEP_OF_CONTACTS
    return found


def scale(system: System, n: int, jumping: bool = False) -> Array:
    """Return the usual size of every number of y; of what only sums up none is needed.

    What laws integrate counts for jumps of f alone: a bristle's stretch grows from the touch on.
    """
    scale = system.scene.world.scale
    length, speed = float(scale[SCALE_LENGTH]), float(scale[SCALE_SPEED])
    of_a_body = [length] * 3 + [0.5] * 4 + [speed] * 3 + [speed / length] * 3
    found = np.full(n, math.inf)
    found[: len(of_a_body) * len(system.body_ids)] = of_a_body * len(system.body_ids)
    states = np.asarray(system.scene.states.offset, dtype=np.int64)
    found[states] = np.maximum(system.scene.states.scale, 1e-300)
    # what friction carries is a stretch or a way over one, and follows the slip as exactly
    for places in (system.scene.slots.x, system.scene.slots.z)[: 2 if jumping else 1]:
        for first in places[places >= 0]:
            found[first : first + 2] = length
    return found

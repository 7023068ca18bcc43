"""Names of a scene's hooks, what they are asked for, and how a failure is handed on.

What only some scenes need stands behind an address in `World.hooks`, 0 where a scene lacks it:
`pipeline.hook_table` says of each when that is, its signature, what it does and what its result
means. A hook returns 0, or the code of its failure; one that answers returns its answer, or less
the code. Its caller hands a code on; where it cannot, as deep within an equation, the code is noted
and the hook that an integrator called returns it.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from mbsim.core.jitable import jitable

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene


class Hook(IntEnum):
    """Entries of `World.hooks`, in the order in which a step comes to them first."""

    CONTACTS = 0  # what contacts are asked for: `Contacts`
    FCL = 1  # distances of pairs without a closed form
    SLOTS = 2  # which incident of a pair is which, where rows are no parts of a shape
    TILTING = 3  # damping of what tilts on a flat face that is one incident
    RECALL = 4  # friction of contacts that keeps something: `Recall`
    SPREAD = 5  # friction over a patch, of laws that keep nothing
    RIM = 6  # friction of a body that stands on a rim
    HOLD_BACK = 7  # friction that steps of fixed length can follow
    VALUE = 8  # value of an expression
    JET = 9  # its value and rates
    APPLIED = 10  # forces between markers, states of the user's own
    WRENCH = 11  # a bushing or a vector force
    ELEMENT = 12  # a Force_Element by its residual
    JOINTS = 13  # what joints are asked for: `Joints`
    STICKING = 14  # contacts whose friction holds without give: `Sticking`
    HIGHER_PAIRS = 15  # equations of points and curves that stay on curves and surfaces
    RELATIONS = 16  # equations that are a user's relation of terms
    LOOPS = 17  # many loops: their multipliers and reactions, by sparse factors: `Loops`
    REACTION_FORCES = 18  # forces by reactions: friction in joints, expressions of them
    EVALUATE = 19  # the whole rhs
    TANGENT = 20  # no hook: where the packed arrays of `compile_model.tangent` are
    BEND = 21  # how forces of equations turn with the bodies
    CONTACT_SLOPES = 22  # derivatives of contacts: `ContactSlopes`
    FACE_SLOPES = 23  # of flat faces that are one incident: `FaceSlopes`
    MEMORY = 24  # friction that carries numbers in y, in linear systems: `Memory`
    SLOPES = 25  # derivatives of forces between markers
    MEMORY_PAIR = 26  # as MEMORY in complex systems
    GAUGES = 27  # what is measured of contacts: `Gauges`
    EFFECTS = 28  # what an error does to contacts, as implicit methods ask: `Effects`
    STABILITY = 29  # what contacts bound steps of fixed length by: `Stability`
    PASSING = 30  # how long pairs of meshes that touch pass through no wall
    FCL_POINTS = 31  # what follows from points that FCL found: `FclPoints`
    DRY = 32  # what Force_DryFriction and Force_Element keep of a step: `Dry`
    ANGLES = 33  # turns of followed angles, ways along curves
    NEAR = 34  # the lists of near pairs
    REQUESTS = 35  # expressions of requests
    STEPPING = 36  # no hook: where the packed arrays of `stepping.arrays` are


class Loops(IntEnum):
    """What many loops are asked for."""

    WEIGH = 0  # find whether sparse factors are faster for the equations in use
    FACTOR = 1  # factor what the equations in use and joints do to each other
    SOLVE = 2  # multipliers of `Sweep.rhs`
    STRESS = 3  # factor how joints and equations would carry loads if all were equally stiff
    RELIEVE = 4  # take self-stresses out of reactions


class Contacts(IntEnum):
    """What contacts are asked for."""

    PUSH = 0  # find who touches whom, and add the forces
    # write the incident table at a committed state: 0, 1 if f changed, CONSTRAINTS_CHANGED
    KEEP = 1
    WATCH = 2  # keep the largest force, depth and slip
    GAPS = 3  # take what shapes moved from the distance of every pair
    ENERGY = 4  # add what is stored and lost to a row of energies
    ROW = 5  # write the columns of contacts in a row of results
    INCIDENTS = 6  # append its incidents: how many
    HARDEST = 7  # which presses hardest, their number for none
    TOUCHED = 8  # mark groups of bodies that ground touches
    CONE = 9  # look whether friction is within its cone, and takes energy
    AT_FAULT = 10  # which presses hardest on the body with the worst error, and 1; 0 for none
    LOOK = 11  # the same as WATCH at an inner point of a step


class Gauges(IntEnum):
    """What is measured of contacts."""

    ERROR = 0  # square of the scaled error of what incidents carry
    STEP = 1  # how much of a step may be tried


class Effects(IntEnum):
    """What an error does to contacts."""

    FRICTION = 0  # change of friction that it causes, over the normal force
    REVERSAL = 1  # the same, with a slip that it turns round
    IMPACT = 2  # change of a closing speed that it causes, over that in a step
    PRESSURE = 3  # change of normal forces that it causes by speed, over them


class Stability(IntEnum):
    """What contacts add to the bound of a step of fixed length: see events.contact_stability."""

    TOUCHING = 0  # to the blocks of bodies; the step that lets nothing pass through anything
    MEETING = 1  # of pairs that are yet to touch, to the bounds of all bodies


class Recall(IntEnum):
    """What friction of contacts is asked for that keeps something: see contact.memory."""

    GIVE = 0  # give the law what it kept
    TAKE = 1  # keep what the law made of it
    COMMIT = 2  # keep it of a step: 0, 1 if f changed, CONSTRAINTS_CHANGED


class FclPoints(IntEnum):
    """What is asked of pairs without a closed form."""

    MOVED = 0  # whether the point of a slot is another than before: 1, else 0
    GAP = 1  # a lower bound of a pair's distance


class FaceSlopes(IntEnum):
    """What derivatives of flat faces are asked for that are one incident: contact_slopes."""

    STIFFNESS = 0  # add how the force changes with depth and tilt: its change where all get deeper
    CENTRE = 1  # add that friction acts elsewhere as tilting moves the centre: 0
    TILTING = 2  # add the couples of a patch that tilts: 0


class ContactSlopes(IntEnum):
    """What derivatives of contacts are asked for."""

    COUPLE = 0  # couple the bodies that touch
    FILL = 1  # add the derivatives


class Joints(IntEnum):
    """What joints are asked for; CHOOSE to SPEED_UP are for assembly, in Python."""

    PROJECT_TREE = 0  # bring a trial point onto the equations, near a fold
    ACCELERATE = 1  # replace accelerations by those that constraints leave
    PROJECT = 2  # bring y onto the equations
    ALONG = 3  # the same of displacements a time
    KEEP = 4  # choose equations anew at a committed state, where the choice has worn
    REACT = 5  # fill reactions
    CHOOSE = 6  # choose the equations to be used
    MATRIX = 7  # residuals and matrix of all equations at y
    DISPLACE = 8  # displace bodies by the multipliers as they stand
    SPEED_UP = 9  # change velocities by them
    AUDIT = 10  # look at the residuals of equations
    READY = 11  # fill all that IMPULSE needs, at y
    IMPULSE = 12  # replace impulses on bodies by the changes of their velocities: see `impulses`
    CLOSE = 13  # bring positions onto the equations by the least change in the norm of the masses
    HOLD = 14  # the same of velocities, behind CLOSE
    AIM = 15  # keep rates of what holds accelerations, at a step's begin
    ASK = 16  # keep the accelerations that it asks for, in a step's midst
    RENEW = 17  # as KEEP, of steps that go through a fold like through any other position


class Dry(IntEnum):
    """What dry friction is asked for."""

    RESTICK = 0  # that what sticks at the point to be evaluated is held, and nothing else
    KEEP = 1  # what it is at a committed state; the answer is 0 or `CONSTRAINTS_CHANGED`


class Sticking(IntEnum):
    """What contacts are asked for whose friction is rigid: see stiction.rigid_contact."""

    LOCATE = 0  # where equations of what sticks act
    SHARE = 1  # share the friction that holds between the contacts
    ASK = 2  # whether one asks for another mode than it has: 1, else 0
    LOAD = 3  # a million times the largest force that holds over its limit
    LOAD_AT_MOST = 4  # no less, at less cost: nothing is shared
    BEGIN = 5  # modes at a committed state: 1 if one changed, else 0
    RELEASE = 6  # let slip what is not held: how many do
    RECORD = 7  # append events
    CHANGED = 8  # whether other slots stick than in the last step: 1, else 0
    LIMIT = 9  # write what each slot is taken to hold at least


class Memory(IntEnum):
    """What friction with memory does in linear systems: see linearization.memory_slopes."""

    FILL = 0  # keep its slopes
    FACTOR = 1  # add its part to the matrix
    RIGHT = 2  # and to a right-hand side
    RECOVER = 3  # write how what slots carry changes


@jitable
def note_failure(scene: Scene, code: int) -> None:
    """Keep the first code where it cannot be returned: `failure_or` hands it on."""
    if code != 0 and scene.users.failed[0] == 0:
        scene.users.failed[0] = code


@jitable
def failure_or(scene: Scene, code: int) -> int:
    """Return the code that was noted, which is forgotten, or `code` if there is none."""
    noted = scene.users.failed[0]
    scene.users.failed[0] = 0
    return noted if noted != 0 else code


@jitable
def answer_of(scene: Scene, answer: int) -> int:
    """Return what a hook answers; 0 where it failed, which is noted."""
    if answer < 0:
        note_failure(scene, -answer)
        return 0
    return answer

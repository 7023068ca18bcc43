"""Every array of the compiled pipeline, grouped by use: shape and meaning on its line.

Counts: nb moving bodies (row nb of a body array is ground), ng graphics, nk kinds, np places
for pairs, nc contacts, ns slots. A *slot* is a place for one incident: a pair owns a range of
slots. A contact of few graphics lists all its pairs for good; one of many, a *crowd*, lists
those that are near, and the list follows the motion (contact.broadphase). Everything is in model
units, global frame unless said otherwise.

The ODE vector y holds, body after body, BODY_SIZE numbers: position of the cg (3), unit
quaternion w first (4), velocity of the cg (3), angular velocity in cg axes (3); then, slot by
slot, X (3) where the law uses it and the law's memory where that is integrated; then the user's own
states, one number each; then the work of motions and what applied forces dissipated, where there
are any (`World.ledger`); last the energy that each contact has dissipated so far (one number where
there is no contact, so that y is never empty).
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core.arrays import F1, F2, F3, I1, I2
from mbsim.core.layout import BODY_SIZE as BODY_SIZE

# columns of `Log.contacts`, one row a contact
(
    PEAK_FORCE,  # largest net |force| over all steps
    PEAK_DEPTH,
    PEAK_SLIP,
    FIRST_TOUCH,  # time; NaN before
    APPROACH,  # closing speed of the last touch
    REBOUND,  # separation speed over closing speed, of the first impact that left again
    TOUCHES,
    PEAK_FORCE_TIME,
    ENERGY_LOST,  # dissipated by the damper and by friction
) = range(9)
LOG_COLUMNS = 9

# entries of `Log.counters`
NARROWPHASE, SKIPPED, FCL_CALLS, FRICTION_CALLS, PYTHON_CALLS, NORMAL_CALLS, LISTINGS = range(7)
COUNTERS = 7

# entries of `Pairs.count`
LIVE, FREE, FIXED, WANTED = range(4)

# why a step was rejected: columns of `Log.rejections`, one row a contact, the last row for none
REJECT_ERROR, REJECT_DEPTH, REJECT_NOT_FINITE, REJECT_NEWTON = range(4)

# entries of `World.doors`
(
    FCL_DOOR,
    NEAR_DOOR,
    APPLIED_DOOR,
    JOINTS_DOOR,
    EXPRESSION_DOOR,
    VALUES_DOOR,
    ANGLES_DOOR,
    FRICTION_DOOR,
    WRENCH_DOOR,
    VALUE_DOOR,
    TANGENT_DOOR,  # the packed arrays of `compile_model.tangent`, where a method is implicit
    SLOPES_DOOR,
    BEND_DOOR,
    EVALUATE_DOOR,  # the whole rhs
    MEMORY_DOOR,  # friction that carries numbers in y, in linear systems
    MEMORY_PAIR_DOOR,  # the same in complex ones
    DRY_DOOR,  # what Force_DryFriction and Force_Element keep of an accepted step
    RESIDUAL_DOOR,  # a Force_Element by its residual
    RIGID_DOOR,  # contacts whose friction holds without give: stiction.rigid_contact
) = range(19)
DOORS = 19

# entries of `Applied.kind`, in no order
(
    LINE_FORCE,
    AXIS_FORCE,
    AXIS_TORQUE,
    VECTOR_FORCE,
    MARKER_FORCE,  # of `forces.catalog`
    RESIDUAL,  # Force_Element
    SLIDE_LIMIT,
    TURN_LIMIT,
    DRY_SLIDE,  # Force_DryFriction along an axis, then about one: forces.dry_friction
    DRY_TURN,
    SLIDE_FRICTION,  # in joints, as the next three
    TURN_FRICTION,
    SCREW_FRICTION,  # slides and turns at once
    BALL_FRICTION,
) = range(14)

# entries of `Applied.par` of a marker force: `forces.catalog.Bounds`, from REST on three numbers
BOUND_STIFFNESS, BOUND_TURNING, BOUND_DAMPING, BOUND_TURNING_DAMPING, BOUND_FORCE, REST = range(6)

# second column of `Applied.late`: components 0 to 5 of a vector force, then
SCALAR, RUBBING = 6, 7

# what is asked for at JOINTS_DOOR
ACCELERATE, PROJECT, REACT, KEEP, SEAT, MATRIX, DISPLACE, SPEED_UP, CHOOSE, ALONG_JOINTS = range(10)

# what is asked for at DRY_DOOR: to keep a step; that what sticks is held, and nothing else
KEEP_DRY, HOLD_AGAIN = range(2)

# what is asked for at RIGID_DOOR, see stiction.rigid_contact
(
    PLACE_HELD,
    SHARE_HELD,
    ASK_HELD,
    BEGIN_HELD,
    RELEASE_HELD,
    RECORD_HELD,
    CHANGED_HELD,
    LOAD_HELD,
) = range(8)

# what of a joint's rotation is free: `Tree.turn`
TURN_LOCKED, TURN_AXIS, TURN_CROSS, TURN_FREE, TURN_ROOT = range(5)

# kinds of terms: `Equations.kind`
OFFSET, PERP, ANGLE, DISTANCE, GENERAL, TOUCHING, TWIST = range(7)

# entries of `Sweep.quality`: when equations were chosen last, the largest of those, and whether
# the committed state is near a position in which a loop can fold; how far the last step left
# the equations before it was brought back onto them, as a local error, and which equation most;
# the least pivot of the factor at hand over its size squared, and
# how many accelerations `Sweep.kept_a` holds; of the last of those their square in the norm of the
# inertia, times the square root of the least pivot, and that pivot; at the committed state the
# least pivot and the time; whether a fold is being passed, when that began and when it ends, and
# until when the next step may go; how far off velocities were behind it, and at which equation;
# power of motions within it
(
    CHOSEN,
    USUAL,
    NEAR_FOLD,
    DRIFT,
    DRIFTER,
    PIVOT,
    KEPT,
    ASKED,
    KEPT_PIVOT,
    PIVOT_THEN,
    PIVOT_TIME,
    FOLDS,
    FOLD_BEGINS,
    FOLD_ENDS,
    FOLD_HALT,
    FOLD_OFF,
    FOLD_AT,
    FOLD_POWER,
) = range(18)

# columns of `Work.applied`: force 3, torque 3, then
STORED_ENERGY, LOST_POWER = 6, 7

# rows of `Audit.found`, one for everything that a run is judged by; `results.audit` has their names
(
    ENERGY,  # kinetic + potential + dissipated - work of motions, against what it was at first
    ENERGY_STEP,  # its change from one sample to the next
    MOMENTUM,  # of a group of bodies that nothing but its weight acts on from outside
    SPIN,  # its angular momentum about its cg
    POSITION,  # residual of an equation of joints and motions over its unit
    VELOCITY,  # of its rate
    HELD_SLIP,  # slip where friction holds
    CONE,  # friction over mu N, as a part of the contact's largest mu N
    NEWTON,  # what Newton's iteration left of an implicit step
    FOLD,  # velocities across a fold behind it, over the usual ones
) = range(10)
AUDITS = 10
# its columns, of the sample in which the value was largest over what was allowed
FOUND_VALUE, FOUND_ALLOWED, FOUND_TIME, FOUND_ELEMENT = range(4)

# entries of `Audit.plan`: steps from one sample to the next, tol, a time at which one is taken
AUDIT_EVERY, AUDIT_TOL, AUDIT_UNTIL = range(3)

# entries of `Audit.tally`: local error of the step tried last, as the norm gave it; steps, and sum
# of their errors, since the last sample and in all; incidents and contact at the last sample, and
# its time; the balance that counts as closed, and the last change from it; potential, dissipated
# energy and work at first; the largest energy of any kind so far; where the balance was worst, and
# when; whether what it was is to be taken anew; the largest energy scale of the error norm so far
(
    ERROR_NOW,
    STEPS_SINCE,
    ERRORS_SINCE,
    STEPS_ALL,
    ERRORS_ALL,
    HITS_THEN,
    CONTACT_THEN,
    TIME_THEN,
    CLOSED_AT,
    OPEN_BY,
    POTENTIAL_FIRST,
    DISSIPATED_FIRST,
    WORK_FIRST,
    LARGEST_ENERGY,
    WORST_OPEN,
    WORST_TIME,
    ANEW,
    USUAL_ENERGY,
) = range(18)
TALLIES = 18

#: What `commit` returns where the motion is held otherwise from here on: equations were taken into
#: use or out of it, or what friction carries became something else.
HELD_OTHERWISE = 2

# kinds of `Rows.events`
TOUCH, LEAVE, STICK, SLIP, SENSOR = range(5)

# entries of `Sensors.compare`
NOT_LESS, NOT_MORE, MORE, LESS, EQUAL = range(5)

# columns of `State.sensed`: expression less value at the committed state, whether it was true,
# what SENVAL shows, what it will show, whether it became true and Python has not yet acted
EXCESS, ON, SHOWN, NEXT, FIRED = range(5)

# columns of `State.dry`: where the slider is, 0 or the sign in which it slides, and both at the
# begin of the last step
SLIDER, SLIDES, SLIDER_BEFORE, SLIDES_BEFORE = range(4)

# columns of `State.sides`: see events.switching
SIDE, HEAT = range(2)
#: What is hotter changes at nearly every step, as the sign of what is at rest does: then steps are
#: not cut there.
HOT = 4.0

# entries of `World.past`
NOW, WITHIN, AGAIN = range(3)

# columns of `Rows.incidents`: what was found, and what the force on it followed from besides y
INC_SLOT, INC_POINT, INC_NORMAL, INC_TANGENT, INC_X, INC_DEPTH = 0, 1, 4, 7, 10, 13
(
    INC_SHARE,  # part of the normal force that this point has
    INC_STEP,  # `h` of the evaluation
    INC_FROZEN,  # whether friction kept its mode
    INC_TOUCHES,  # points of its pair at the committed state
    INC_KIND,
    INC_GRAPHIC_I,  # of the pair
    INC_GRAPHIC_J,
) = range(14, 21)
#: The couple for a unit of energy (3), and the memory of friction at the begin of the step, as long
#: as `State.before` is wide.
INC_COUPLE, INC_MEMORY = 21, 24
#: Numbers at the end of a row of `Rows.incidents` where pairs are one incident: area, and moments
#: xx, xy, yy (see geometry.catalog).
INC_REGION = 4
#: Of these, where friction is rigid: what holds along x and y, see laws.friction.stiction.
INC_HELD = INC_MEMORY + 3


#: Entry of `World.scale` that holds the tolerance of a run.
TOLERANCE = 3


class Bodies(NamedTuple):
    """Moving bodies."""

    mass: F1  # (nb,) scaled so that F = m a
    inertia: F3  # (nb, 3, 3) about the cg, in cg axes
    inverse: F3  # (nb, 3, 3) its inverse


class Graphics(NamedTuple):
    """Shapes that take part in contacts."""

    body: I1  # (ng,)
    p: F2  # (ng, 3) centre, in the body's cg axes
    R: F3  # (ng, 3, 3) shape axes to cg axes
    size: F2  # (ng, 3) see geometry.catalog
    reach: F1  # (ng,) radius of the ball around the centre that holds the shape; inf for a plane
    half: F2  # (ng, 3) half edges of the box in shape axes that holds the shape; inf for a plane
    turns: I1  # (ng,) 0 for a sphere, whose surface a rotation about its centre does not move
    thin: F1  # (ng,) half of the thinnest side; inf for a plane
    shape: I1  # (ng,) class of shape, see `Crowds.kind`
    marker_p: F2  # (ng, 3) reference marker, in cg axes
    marker_R: F3  # (ng, 3, 3)


class Kinds(NamedTuple):
    """How two shapes of a contact are tested against each other."""

    contact: I1  # (nk,)
    kernel: I1  # (nk,) address, 0 where FCL does it
    slots: I1  # (nk,) points it gives at most
    swapped: I1  # (nk,) 1 where the kernel's I is the contact's J
    regroups: I1  # (nk,) 1 where points may appear deep in a contact that goes on
    whole: F1  # (nk,) shares of a flat face, where a pair is one incident with its area; else 0
    noise: F1  # (nk,) scatter of the normals that its detector gives


class Pairs(NamedTuple):
    """Graphics that may touch, in the order that their kernel wants; saved with the state."""

    kind: I1  # (np,)
    graphic_i: I1  # (np,) the kernel's I
    graphic_j: I1  # (np,)
    slot: I1  # (np,) first slot
    last: I1  # (np,) one behind the last slot
    touches: I1  # (np,) slots that touched at the committed state
    gap: F1  # (np,) distance that the pair kept when last measured
    left: F1  # (np,) what the motion since has left of it for certain
    live: I1  # (np,) places in use, ascending; those of crowds behind all others
    free: I1  # (np,) places not in use, the next one last
    count: I1  # (4,) live, free, live for good, places that a listing lacked


class Crowds(NamedTuple):
    """Contacts of many graphics, whose near pairs are found as they move."""

    contact: I1  # (crowds,)
    same: I1  # (crowds,) 1 where I and J are one set: each pair once, none on one body
    first: I2  # (crowds, 4) where I begins and ends in `member`, where J begins and ends
    member: I1  # graphics
    kind: I2  # (crowds, shapes^2) kind by shape class of I and of J, -1 for none
    swap: I2  # (crowds, shapes^2) 1 where the kernel wants the other order
    size: F1  # (2,) a pair is near if its boxes are nearer than the first; a usual reach
    reference: F2  # (ng, 7) centre and quaternion of the body when pairs were last listed
    room: F1  # (ng,) how far any point may still move before that; inf for who is in no crowd
    box: F2  # (ng, 6) lower and upper corner then
    cell: I1  # (ng,) of the grid
    order: I1  # (ng,) members cell by cell
    start: I1  # (cells + 1,) where a cell begins in `order`
    head: I1  # (ng,) first place of a pair whose I is this graphic, -1 for none
    next: I1  # (np,) next place of the same I
    moved: I2  # (np, 5) where a pair's place was put, and its kind, graphics and touches
    spare: F2  # (ns, SPARE) what is moved with the slots that touch


class Contacts(NamedTuple):
    """Force_Contact elements."""

    id: I1  # (nc,)
    normal_law: I1  # (nc,) address
    normal_par: F2  # (nc, widest)
    friction_law: I1  # (nc,) address, 0 for none
    friction_par: F2  # (nc, widest)
    sliding_law: (
        I1  # (nc,) address of the user's function that gives a law's sliding friction, or 0
    )
    sliding_par: F2  # (nc, widest)
    interpreted: I1  # (nc,) 1 where the friction law enters Python
    framed: I1  # (nc,) 1 where the law needs the incident marker's own axes
    memory: I1  # (nc,) numbers that the friction law keeps
    carried: I1  # (nc,) how many of these are part of y
    ignore_deeper: F1  # (nc,) inf if not given
    dmax: F1  # (nc,) 0 if not given
    reads_x: I1  # (nc,) 1 where an error of X counts
    user_normal: I1  # (nc,) where `laws.user_normal` has its place, 0 for a built-in normal law
    rigid: I1  # (nc,) 1 where friction holds by equations: stiction.rigid_contact


class Slots(NamedTuple):
    """Places for incidents."""

    pair: I1  # (ns,)
    x: I1  # (ns,) where X starts in y, -1 where it is not carried
    z: I1  # (ns,) where the law's memory starts in y, -1 where it is not integrated


class Markers(NamedTuple):
    """Markers that joints, forces and expressions look at; row 0 is the global frame."""

    body: I1  # (nm,)
    p: F2  # (nm, 3) in the body's cg axes
    R: F3  # (nm, 3, 3)


class Angles(NamedTuple):
    """Angles of one marker about the z-axis of another that are followed over whole turns."""

    i: I1  # (na,) markers
    j: I1  # (na,)


class Programs(NamedTuple):
    """Expressions as instructions of a stack machine."""

    start: I1  # (programs + 1,) first instruction of each
    code: I2  # (instructions, 6) operation and up to five numbers, see compile_model.programs
    number: F1  # constants
    stack: F2  # (deepest, 3) scratch: value, first and second derivative
    quick_start: I1  # (programs + 1,) the same for values alone
    quick: I2  # (instructions, 6) with operations by a number in one, see compile_model.programs
    operand: F1  # (instructions,) the number that each of `quick` takes, if it takes one
    values: F1  # (deepest + 1,) scratch: values alone
    level: F1  # (curves,) z of a curve of a spline
    curve: I1  # (curves + 1,) first piece of each
    piece: F2  # (pieces, 5) where it begins, and the factors of 1, s, s^2, s^3


class States(NamedTuple):
    """States of the user's own."""

    program: I1  # (nz,) their slopes
    place: I1  # (nz,) in y
    scale: F1  # (nz,) size below which an error counts as one at this size


class Sensors(NamedTuple):
    """What is watched, and acted on in Python when it becomes true."""

    id: I1  # (n,)
    program: I1  # (n,)
    evaluate: I1  # (n,) program whose value SENVAL shows, -1 for none
    compare: I1  # (n,) NOT_LESS, ...
    value: F1  # (n,)
    width: F1  # (n,) how far from the value counts as there
    located: I1  # (n,) 1 where a step ends at the crossing


class Kinks(NamedTuple):
    """What may change its branch within a step, which then ends there: compile_model.switching."""

    program: I1  # (n,) that tells the sides of an expression's switches, -1 for a limit
    limit: I1  # (n,) row of `Applied`, -1 for an expression; the last may have neither: it is
    # for what all incidents do whose friction has modes


class Users(NamedTuple):
    """User subroutines of forces and variables, see expressions.subroutines."""

    address: I1  # (nu,) of their guarded C functions, 0 for a residual
    element: I1  # (nu,) row of `Residuals`, -1 for a subroutine
    result: F2  # (nu, most) what each returned last
    failed: I1  # (1,) code of the first that failed in this evaluation, or 0
    seen: F1  # (ny,) y when a friction subroutine that looks at it is called; else (0,)


class Residuals(NamedTuple):
    """Force_Element: forces whose unknowns a user's residual makes 0, see forces.force_element.

    Rows have na directions and nu unknowns each, at most `axes` and `unknowns`; what they give as
    `Users.result`: less f along every direction, f' of states, f of every unknown, the mode.
    """

    id: I1  # (n,)
    i: I1  # (n,) markers
    j: I1  # (n,)
    first: I1  # (n + 1,) first direction of each
    begin: I1  # (n + 1,) first unknown of each
    axis: I1  # (directions,) marker whose z it is
    angle: I1  # (directions,) row of `Angles` of a turn, -1 for a slide
    kind: I1  # (unknowns,) of laws.residual
    state: I1  # (unknowns,) row of `States`, -1 for none
    place: I1  # (unknowns,) in y, -1 for none
    initial: F1  # (unknowns,)
    scale: F1  # (unknowns,) a usual size
    address: I1  # (n,) of the residual
    twin: I1  # (n,) of the interpreted one, which says why it fails
    interpreted: I1  # (n,) 1 where `address` enters Python
    user: I1  # (n,) row of `Users`
    par: F2  # (n, widest)
    given: F1  # (inputs,) scratch
    out: F1  # (unknowns,) scratch, as all below, of one element
    base: F1
    start: F1
    z: F1
    step: F1
    size: F1
    rows: F1
    by: F3  # (2, unknowns, unknowns) residual by f and by f'
    moves: F3  # (2, unknowns, directions) residual by x and by x'
    A: F2  # (unknowns, unknowns)
    swap: I1
    rise: F1
    slopes: F3  # (3, unknowns, wide) unknowns by x, x' and states
    trouble: I1  # (1,) row of the element that was not solved, -1 for none


class Applied(NamedTuple):
    """Forces between two markers: springs, dampers, expressions, limits and friction of joints."""

    kind: I1  # (nf,) see forces.applied
    with_reactions: (
        I1  # (nf,) 1 where it is settled with the reactions: friction in joints, and what
    )
    # looks at reactions (forces.reaction_forces)
    i: I1  # (nf,) markers
    j: I1  # (nf,)
    par: F2  # (nf, widest) stiffness, damping, length, preload; of friction radius, preload, arm;
    # of marker forces what a step must follow; of dry friction its stiffness (0: rigid) and the
    # force at which it slides on and at which it begins to
    program: I1  # (nf,) -1 for none
    components: I2  # (nf, 6) programs of force and torque of a vector force, -1 for none
    axes: I1  # (nf,) marker whose axes those components are along, whose z dry friction is
    angle: I1  # (nf,) row of `Angles`, -1 for none
    alone: I1  # (nf,) 1 where nothing acts on J
    bounds: F2  # (nf, 2) of limits
    law: I1  # (nf,) address of a normal or friction law or a marker force, 0 for none
    law_par: F2  # (nf, widest)
    slopes: I1  # (nf,) address of the slopes of a marker force, 0 for none or where not asked for
    id: I1  # (nf,) of the element
    connection: I1  # (nf,) whose reaction presses, -1 for none
    equation: I1  # (nf,) that holds rigid dry friction while it sticks, -1 for none
    late: I2  # (nu, 3) what is settled with the reactions: row, component, program, -1 for friction


class Tree(NamedTuple):
    """Bodies that constraints hold, each hung on its parent by one joint, parents first.

    A body without such a joint is a root that moves freely. The bodies of one root follow each
    other.
    """

    body: I1  # (nt,)
    parent: I1  # (nt,) place in the tree, -1 for ground
    of_body: I1  # (nb + 1,) place in the tree, -1 for none
    root: I1  # (nt,) place of the first body of its tree
    end: I1  # (nt,) one behind the last place of its tree
    turn: I1  # (nt,) what of the rotation is free: TURN_...
    slide: I2  # (nt, 3) 1 where the child may move along that axis of the parent's marker
    axis: I2  # (nt, 2) of UNIVERSAL: axis of the child's and of the parent's marker
    child_p: F2  # (nt, 3) joint marker on the child, in its cg axes
    child_R: F3  # (nt, 3, 3) turned so that it is along the parent's where the joint holds it
    parent_p: F2  # (nt, 3)
    parent_R: F3  # (nt, 3, 3)
    free: I1  # (nt,) number of free directions


class Equations(NamedTuple):
    """Constraint equations that the tree does not hold by itself: loops, motions, couplers.

    An equation is a sum of terms, less a function of TIME, = 0; see constraints.equations.
    """

    first: I1  # (ne + 1,) first term of each
    program: I1  # (ne,) function of TIME, or the whole of a general constraint; -1 for none
    level: I1  # (ne,) 2 holds displacements, 1 velocities, 0 accelerations
    general: I1  # (ne,) 1 where the program is the whole equation
    constant: F1  # (ne,)
    start: F2  # (ne, 2) sum and its rate that assembly brings about where no level does; or NaN
    unit: F1  # (ne,) what a residual is measured by: L, or 1 for angles
    connection: I1  # (ne,) the element that it belongs to
    dry: I1  # (ne,) row of `Applied` that it holds while that sticks, -1 for any other
    slot: I1  # (ne,) slot that it holds along x or y while that sticks, -1 for any other
    kind: I1  # (terms,)
    i: I1  # (terms,) markers
    j: I1  # (terms,)
    axis: I2  # (terms, 2) of I and of J; of TOUCHING 0 or 1 for x or y, and the slot
    factor: F1  # (terms,)
    angle: I1  # (terms,) row of `Angles`, -1 for none
    active: I1  # (ne + 1,) equations in use, ascending, their number last; saved with the state


class Connections(NamedTuple):
    """Elements with reactions: joints, primitives, couplers, motions, general constraints."""

    i: I1  # (nj,) markers
    j: I1  # (nj,)
    tree: I1  # (nj,) place in the tree, -1 where equations hold it
    flip: I1  # (nj,) 1 where I is on the parent


class World(NamedTuple):
    """What belongs to no element."""

    gravity: F1  # (3,) what of it is constant
    weight: I2  # (1 + .., 3) programs of components that are expressions, -1 for none: those in
    # force, then those of every gravity of the model
    scale: F1  # (4,) length L, speed V and energy of the whole model, for difference quotients and
    # what is rounding, and the tolerance; errors are judged by `Scales`
    doors: I1  # (DOORS,) addresses of what only some scenes need
    fixed_step: I1  # (1,) 1 for a method without error estimate
    past: I1  # (1,) WITHIN while a point of the last step is evaluated, AGAIN while a row is
    ledger: I1  # (2,) where in y the work of motions and the damped energy stand, -1 for nowhere


class Scales(NamedTuple):
    """What errors of n groups of connected bodies are judged by: `compile_model.groups`."""

    group: I1  # (nb,) of a body
    length: F1  # (n,) L
    speed: F1  # (n,) the least V, weight left out
    mass: F1  # (n,) of the heaviest body
    of_contact: I1  # (nc,) group by which a contact's energy is judged
    gyration: F1  # (nb,) radius


class State(NamedTuple):
    """The physical state beside y: the incident table, and where everything was."""

    q: F2  # (nb + 1, 4) quaternions at the committed state
    w: F2  # (nb + 1, 3) angular velocities at the committed state, global frame
    since: F1  # (1,) time of the committed state
    centre: F2  # (ng, 3) centres of the graphics at the committed state
    angle: F1  # (na,) at the committed state, whole turns included
    touching: I1  # (ns,)
    p: F2  # (ns, 3) contact point
    n: F2  # (ns, 3) normal from J into I
    t: F2  # (ns, 3) x-axis of the incident marker
    depth: F1  # (ns,)
    rate: F1  # (ns,) of depth
    normal: F1  # (ns,) normal force
    memory: F2  # (ns, most) of friction laws
    before: F2  # (ns, most) the same at the begin of the last step
    mode: F1  # (ns,) branch of a friction law with memory: see laws.catalog
    hit: I1  # (ns + 1,) slots that touched, their number last
    sensed: F2  # (sensors, 5) see the names above
    sides: F2  # (kinks, 2) side at the committed state, how often it changed of late
    frozen: I1  # (1,) 1 where friction keeps its modes within a step, which ends where one changes
    dry: F2  # (nf, 4) of dry friction, see the names above
    residual: F3  # (elements, 2, 1 + axes + 2 unknowns) time, x, f and f' at the committed state,
    # and at the begin of the last step
    fastest: F1  # (n,) what the largest speed so far of a group counts: pipeline.scales
    heat: F1  # (2,) of contacts whose friction is rigid: heat as of sides, 1 where one asked for
    # another mode since the committed state: see events.switching


class Log(NamedTuple):
    """What is counted and watched over all steps; saved with the state."""

    contacts: F2  # (nc, LOG_COLUMNS)
    counters: I1  # (COUNTERS,)
    rejections: I2  # (nc + 1, 4)


class Audit(NamedTuple):
    """What a run judges itself by, see pipeline.audit; saved with the state."""

    tied: I1  # (groups,) of `Scales`: 1 where something but a contact ties it to ground
    cone: F1  # (nc,) largest friction over normal force, inf where the law has none
    plan: F1  # (3,) see the names above, as for all here
    tally: F1  # (TALLIES,)
    momentum: F2  # (groups, 7) linear 3, angular 3, 1 where ground touched it; of the last sample
    sums: F2  # (groups, 13) scratch, see pipeline.audit
    first: I1  # (groups,) first body of each
    contact: F2  # (nc + 1, 4) change of balance while this contact pressed hardest (last row: none
    # touched), the largest of one sample, and when; largest mu N
    energy: F1  # (4,) as of `Rows.energy`
    found: F2  # (AUDITS, 4)


class Work(NamedTuple):
    """All that follows from (y, committed state). Filling it with NaN first changes nothing."""

    R: F3  # (nb + 1, 3, 3) cg axes to global
    v: F2  # (nb + 1, 3)
    w: F2  # (nb + 1, 3) angular velocity, global frame
    force: F2  # (nb + 1, 3)
    torque: F2  # (nb + 1, 3) about the cg
    noise: F2  # (nb + 1, 2) force and torque that the detector's noise may be wrong by
    frames: F2  # (ng, 12)
    way: F1  # (ng,) how far any point may have moved since the committed state
    speed: F2  # (ng, 2) of its fastest point, and acceleration of its centre
    points: F2  # (ns, POINT) candidates of geometry.catalog
    touching: I1  # (ns,)
    hit: I1  # (ns + 1,) slots that touch, their number last
    t: F2  # (ns, 3) x-axis of the incident marker at the trial point
    slot: F2  # (ns, SLOT_COLUMNS) see contact.forces
    memory: F2  # (ns, most) of friction laws at the trial point
    kept: F2  # (ns, 3 + most) while a step is followed in two halves: friction along x and y of the
    # whole step and what an error of it counts as, what is committed
    grip: F2  # (ns, 4) friction over N by slip, 2 x 2 by rows, where it was linearised last
    fcl: I1  # (np,) pairs that FCL shall do
    net: F2  # (nc, 3) force of each contact
    block: F2  # (nb, 20) stiffness that acts on a body (3 x 3) and its turning part, damping
    bound: F1  # (2,) squared frequency and rate of damping, the largest so far
    best: F1  # (4,) pair that gave it: contact, energy at touch, force behind it, inverse mass
    idle: F1  # (ny,) y' at points that are only looked at; (0,) where none is
    ahead: F2  # (2, ny) y and y' a little later; (0, 0) where no rates of forces are looked for
    law_in: F1  # (FRICTION_INPUTS + most,)
    law_out: F1  # (MEMORY_OUT + 2 most,)
    applied: F2  # (nf, 8) force, torque on I at the I marker, stored energy, dissipated power
    motion: F1  # (12,) of a marker force: see forces.abi, as the next two
    wrench: F1  # (8,)
    slopes: F2  # (12, 6)
    rub: F2  # (nf, 9) of friction: see forces.joint_friction
    late: F2  # (nu, 5) of what is settled with the reactions, see forces.reaction_forces
    secant: F2  # (nu, nu) how that follows from what it misses
    reaction: F1  # (6 nj,) force, torque on I's body at the I marker of each connection
    squares: F1  # (n,) V^2 of each group of bodies at the point that an error is judged at
    trouble: I1  # (2,) worst body of the error norm, contact at fault
    hold: F2  # (ns, 15) of slots that stick: contact point, n, x-axis, rates of point and n
    held: F2  # (ns, 2) forces that hold these, along x and y
    look: F3  # (3, points, POINT) candidates of a pair now, a moment later and before; no rows
    # for the three where none is rigid


class Sweep(NamedTuple):
    """Scratch of the articulated-body recursion.

    Spatial vectors are (angular, linear) about O, the cg of the root of each tree at the trial
    point.
    """

    H: F3  # (nt, 6, 6) articulated inertia
    S: F3  # (nt, 6, 6) free directions by rows
    W: F3  # (nt, 6, 6) L^-1 S'H by rows, L L' = S'H S
    L: F3  # (nt, 6, 6)
    c: F2  # (nt, 6) acceleration of the child that follows from velocities
    p: F2  # (nt, 6) force that the body would need, articulated
    z: F2  # (nt, 6) forces, then accelerations, in the free directions
    a: F2  # (nt, 6) acceleration
    arm: F2  # (nt, 3) cg from O
    bias: F2  # (nt, 6) force that velocities call for
    answer: F2  # (nt, 6) accelerations by a unit multiplier
    mark: I1  # (nt,) by root: equation for which `answer` was made
    chosen: I1  # (ne + 1,) `Equations.active` before others are chosen
    G: F2  # (terms, 12) of each term: wrench on I's body and on J's, each about its O
    rate: F2  # (ne, 4) residual, its rate, its second rate by velocities alone, rate of its sum
    A: F2  # (ne, ne) how equations act on each other, then its factor
    multiplier: F1  # (ne,)
    rhs: F1  # (ne,)
    skyline: I1  # (ne,) first column of a row of A
    size: F1  # (ne,) square root of what A would have if the bodies were free
    released: I1  # (ne,) equations that do not hold while a loop passes a fold
    wanted: F1  # (ne,) multipliers of equations alone, near a fold
    kept_at: F1  # (8,) times of the last committed states that no loop was about to fold in
    kept_a: F3  # (8, nt, 6) what multipliers did to accelerations then
    kept_power: F1  # (8,) power of motions then
    quality: F1  # (18,) least pivot over its size squared, see the names above
    stress: F2  # (ne, 6 nj) self-stresses of implied equations
    jet: F1  # (12,) what a program gives
    share: F2  # (nh, nh) slips of what sticks, by rows: S of stiction.cones, and its matrix
    mix: F2  # (nh, nh)
    cone: F2  # (CONE_ROWS, nh) its vectors
    kept_p: F2  # (nt or 0, 6) p while others are tried


class Rows(NamedTuple):
    """Output rows not yet taken by Python."""

    time: F1  # (rows,)
    y: F2  # (rows, n)
    accel: F2  # (rows, 6 nb)
    contact: F2  # (rows, CONTACT_COLUMNS nc)
    energy: F2  # (rows, 4) kinetic, potential, dissipated, work of motions
    joint: F2  # (rows, 6 nj) force, torque on I's body at the I marker, global, of `Connections`
    applied: F2  # (rows, 6 nf) the same of `Applied`
    value: F2  # (rows, values) expressions of requests
    incident_count: I1  # (rows,)
    incidents: F2  # (capacity, INC_MEMORY + most) slot, p, n, t, X, depth, ...: see above
    events: F2  # (capacity, 4) time, kind, contact, slot
    used: I1  # (3,) rows, incidents, events


#: Rows of `Sweep.cone`: those of stiction.cones, and three of stiction.rigid_contact.
CONE_ROWS = 12
SLOT_COLUMNS = 28
#: What `crowd.put_aside` keeps of a slot, and twice the memory: frames, mode, point, `Work.slot`.
SPARE = 24 + SLOT_COLUMNS
CONTACT_COLUMNS = 10  # force 3, torque 3, depth, slip, incidents, area


class Scene(NamedTuple):
    """Everything a compiled hook gets through its one address."""

    bodies: Bodies
    graphics: Graphics
    kinds: Kinds
    pairs: Pairs
    crowds: Crowds
    contacts: Contacts
    slots: Slots
    markers: Markers
    angles: Angles
    programs: Programs
    states: States
    sensors: Sensors
    kinks: Kinks
    users: Users
    residuals: Residuals
    applied: Applied
    tree: Tree
    equations: Equations
    connections: Connections
    world: World
    scales: Scales
    state: State
    log: Log
    audit: Audit
    work: Work
    sweep: Sweep
    rows: Rows

"""Numbers with names: columns of tables, kinds, entries of counters, what is asked for."""

from __future__ import annotations

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
    BEYOND_TIME,  # of the first overlap too deep for its force to be trusted; NaN before
    BEYOND_I,  # rows of the graphics of that overlap
    BEYOND_J,
) = range(12)
LOG_COLUMNS = 12

# the last column of `Log.samples`, whose first ones are those of PEAK_FORCE, PEAK_DEPTH, PEAK_SLIP
SAMPLE_RATE = 3
SAMPLE_COLUMNS = 4
#: Rows of `Log.ends` and `Log.end_times`: the step's end before the last one, the last one.
END_BEFORE, END_LAST = range(2)
# rows of it: what is known of a step from its ends, and looks into it
SAMPLES = 3 + 12

# entries of `Log.counters`
NARROWPHASE, SKIPPED, FCL_CALLS, FRICTION_CALLS, PYTHON_CALLS, NORMAL_CALLS, LISTINGS = range(7)
TOO_DEEP = 7
COUNTERS = 8

# entries of `Pairs.count`
ACTIVE, FREE, FIXED, WANTED = range(4)

# why a step was rejected: columns of `Log.rejections`, one row a contact, the last row for none
REJECT_ERROR, REJECT_DEPTH, REJECT_NOT_FINITE, REJECT_NEWTON = range(4)

# entries of `Applied.form`, in no order
(
    LINE_FORCE,  # scalar forces: dynamics.forces.applied
    AXIS_FORCE,
    AXIS_FORCE_AT_I,
    AXIS_TORQUE,
    VECTOR_FORCE,  # components by expressions
    WRENCH,  # of `forces.catalog`
    RESIDUAL,  # Force_Element
    MULTI_POINT,  # a marker of several: dynamics.forces.multi_point
    SLIDE_FRICTION,  # in joints, as the next three
    TURN_FRICTION,
    SCREW_FRICTION,  # slides and turns at once
    BALL_FRICTION,
) = range(12)

# columns of `Applied.bound`: `forces.catalog.Bounds`, from REST on three numbers
BOUND_STIFFNESS, BOUND_TURNING, BOUND_DAMPING, BOUND_TURNING_DAMPING, BOUND_FORCE, REST = range(6)
BOUNDS = 8

# the column of `Applied.par` of a RESIDUAL: its row of `Residuals`
OF_ELEMENT = 0

# columns of `Applied.par` of a MULTI_POINT: how many markers there are, then the rows of these
POINTS, OF_POINTS = range(2)

# columns of `State.residual`: from the second on x, f and f'
AT_TIME = 0

# columns of `Applied.par` of what slides (`Applied.keeps`): stiffness, 0 where it is rigid; the
# force of slip, and the one that begins it
SLIDER_STIFFNESS, SLIDER_LIMIT, SLIDER_STATIC = range(3)

# columns of `Applied.by_reactions`
ROW_OF, COMPONENT, PROGRAM = range(3)

# its second column: components 0 to 5 of a vector force, then
SCALAR, JOINT_FRICTION = 6, 7

# columns of `Tree.axis`: the child's and the parent's marker
CHILD_AXIS, PARENT_AXIS = range(2)

# columns of `Equations.axis`, and of `Equations.start`
AXIS_I, AXIS_J = range(2)
START_SUM, START_RATE = range(2)

# columns of `Pattern.pair`: bodies of a block's row and of its column
BLOCK_ROW, BLOCK_COLUMN = range(2)

# columns of `Keeps.press`
PRESS_BY_DEPTH, PRESS_BY_RATE = range(2)

# columns of `Real.c`: coefficients of `linearization.newton_matrix`
C1, C2, C3, FORM = range(4)

# what of a joint's rotation is free: `Tree.turn`
TURN_LOCKED, TURN_AXIS, TURN_CROSS, TURN_FREE, TURN_ROOT = range(5)

# what the program of an equation is, beside a function of TIME alone: `Equations.general`
WHOLE, OF_STATE = 1, 2

# kinds of terms: `Equations.kind`
OFFSET, PERP, ANGLE, DISTANCE, GENERAL, TOUCHING, TWIST, HIGHER_PAIR = range(8)

# kinds of higher pairs: what is held on what
POINT_ON_CURVE, CURVE_ON_CURVE, POINT_ON_SURFACE = range(3)

# columns of `Surfaces.start` and its like
ALONG_U, ALONG_V = range(2)

# entries of `Sweep.pair`
PAIR_VALUE, PAIR_RATE, PAIR_SECOND = range(3)
#: Results of a user's relation of n terms: its value, then n slopes, then n by n second ones.
RELATION_VALUE, RELATION_SLOPES = range(2)

#: How many entries `Sweep.quality` has.
QUALITIES = 20
# They are: when equations were chosen last, the largest of those, and whether
# the committed state is near a position in which a loop can fold; how far the last step left
# the equations before it was brought back onto them, as a local error, and which equation most;
# the least pivot of the factor at hand over its size squared, and
# how many accelerations `Sweep.kept_a` holds; of the last of those their square in the norm of the
# inertia, times the square root of the least pivot, and that pivot; at the committed state the
# least pivot and the time; whether a fold is being passed, when that began and when it ends, and
# until when the next step may go; how far off velocities were behind it, and at which equation;
# power of motions within it; the largest residual, over its unit, that Newton's method left of what
# closes loops, and of which equation
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
    LEFT_OPEN,
    OPEN_AT,
) = range(QUALITIES)

# columns of `Sweep.aim`, and entries of `Sweep.aimed`: the begin of a step that asks for rates of
# equations that hold accelerations, the time for which it does now, and the work that equations did
# when velocities were held last
RATE_BEGUN, ASKED_FOR = range(2)
AIMED_FROM, AIMED_AT, AIMED_WORK = range(3)

#: Impulses that trees of joints answer at once, those of five points (`impulses`).
AT_ONCE = 16

# columns of `Work.noise`
NOISE_FORCE, NOISE_TORQUE = range(2)

# columns of `Work.speed`
FASTEST_POINT, CENTRE_ACCELERATION = range(2)

# columns of `Work.kept`
WHOLE_X, WHOLE_Y, COUNTS_AS, COMMITTED = range(4)

# columns of `Broadphase.first`, of `moved`, and the first ones of `spare` for pairs
FIRST_I, LAST_I, FIRST_J, LAST_J = range(4)
MOVED_TO, MOVED_KIND, MOVED_I, MOVED_J, MOVED_TOUCHES = range(5)
SPARE_GAP, SPARE_LEFT = range(2)

# columns of `Programs.stack`, the first ones of `Programs.code`, the first of `Programs.piece`
JET_VALUE, JET_SLOPE, JET_CURVATURE = range(3)
CODE_OPERATION, CODE_OPERAND = range(2)
PIECE_BEGIN = 0

# columns of `Work.applied`; force and torque take three
APPLIED_FORCE, APPLIED_TORQUE, STORED_ENERGY, LOST_POWER = 0, 3, 6, 7

# rows of `Audit.found`, one for everything that a run is judged by; `results.audit` has their names
(
    ENERGY,  # kinetic + potential + dissipated - work of motions, against what it was at first
    ENERGY_STEP,  # its change from one sample to the next
    MOMENTUM,  # of a group of bodies that nothing but its weight acts on from outside
    SPIN,  # its angular momentum about its cg
    POSITION,  # residual of an equation of joints and motions over its unit
    VELOCITY,  # of its rate
    STICKING_SLIP,  # slip where friction holds
    CONE,  # friction over mu N, as a part of the contact's largest mu N
    NEWTON,  # what Newton's iteration left of an implicit step
    FOLD,  # velocities across a fold behind it, over the usual ones
    DRIVES,  # energy that friction gave beyond what it took
    PENETRATION,  # depth of rigid contacts
    UNSOLVED_IMPULSES,  # what a step's contact problem is left unsolved by, as a velocity
    STEP_END,  # how far impacts in a step of given length leave its end from that of two halves
) = range(14)
AUDITS = 14
#: How many times what is explained friction may give, beyond which time and element are kept.
DRIVES_LIMIT = 30.0
# its columns, of the sample in which the value was largest over what was allowed
FOUND_VALUE, FOUND_ALLOWED, FOUND_TIME, FOUND_ELEMENT = range(4)

# columns of `Audit.friction`: work that friction of a contact did on the bodies so far, the least
# that it was where friction had nothing in store, and whether the contact touches at the sample
WORK_NOW, WORK_THEN, TOUCHED_NOW = range(3)

# entries of `Audit.plan`: steps from one sample to the next, tol, a time at which one is taken
AUDIT_EVERY, AUDIT_TOL, AUDIT_UNTIL = range(3)
# entries of `Awake.count`; columns of `Awake.rest`, behind the mass the centre
AWAKE_BODIES, AWAKE_GRAPHICS = range(2)
REST_MASS, REST_CENTRE, REST_SPREAD = 0, 1, 4

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
CONSTRAINTS_CHANGED = 2

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
SIDE, CHATTERING = range(2)
# entries of `State.chattering`: how often sticking changed of late, whether it asks to change now;
# how many incidents that go on changed their mode since the last step was passed; 1 where one that
# was there at the begin of the step is not at the point asked last
CHANGES, ASKS, CHANGED, LEFT = range(4)
#: What chatters more changes at nearly every step, as the sign of what is at rest does: then
#: steps are not cut there.
CHATTERS = 4.0

# entries of `World.past`
NOW, WITHIN, REPLAYED = range(3)

# of `Work.diagnostics`: the worst body of the error norm; what is at fault, a contact or a row of
# `Applied`
WORST_BODY, AT_FAULT = range(2)
# columns of `Work.friction_slope`: how friction along x or y changes with slip along x or y
X_BY_X, X_BY_Y, Y_BY_X, Y_BY_Y = range(4)

# columns of `Rows.incidents`: what was found, and what the force on it followed from besides y
INC_SLOT, INC_POINT, INC_NORMAL, INC_TANGENT, INC_X, INC_DEPTH = 0, 1, 4, 7, 10, 13
(
    INC_WEIGHT,  # part of the normal force that this point has
    INC_STEP,  # `h` of the evaluation
    INC_FROZEN,  # whether friction kept its mode
    INC_TOUCHES,  # points of its pair at the committed state
    INC_KIND,
    INC_GRAPHIC_I,  # of the pair
    INC_GRAPHIC_J,
) = range(14, 21)
#: The couples for a unit of energy (3) and of force (3), and the memory of friction at the begin of
#: the step, as long as `State.before` is wide.
INC_COUPLE, INC_COUPLE_OF_FORCE, INC_MEMORY = 21, 24, 27
#: Numbers at the end of a row of `Rows.incidents` where pairs are one incident: area, and moments
#: xx, xy, yy, then the gain of a patch (see geometry.catalog).
INC_REGION = 5
#: Of these, where friction is rigid: what holds along x and y, see laws.friction.stiction.
INC_STICKING = INC_MEMORY + 3


# entries of `Work.best`, of a pair: contact, energy at touch, the force behind it, inverse mass
BEST_CONTACT, BEST_ENERGY, BEST_FORCE, BEST_INVERSE = range(4)

# columns of `Rows.points`: force on I's body, slip speed, area of a region, row of `Contacts`
POINT_FORCE, POINT_SLIP, POINT_AREA, POINT_CONTACT, POINT_COLUMNS = 0, 3, 4, 5, 6

# entries of `World.scale`
SCALE_LENGTH, SCALE_SPEED, SCALE_ENERGY, TOLERANCE = range(4)

# columns of `Rows.energy`, entries of `Audit.energy`
KINETIC, POTENTIAL, DISSIPATED, WORK_OF_MOTIONS = range(4)
# entries of `World.accumulators`
OF_MOTIONS, OF_DAMPERS = range(2)
# columns of `Audit.contact`
CHANGE, LARGEST_CHANGE, CHANGED_AT, LARGEST_FRICTION = range(4)
# columns of `Audit.momentum`: linear, angular, whether ground touched
LINEAR, ANGULAR, TOUCHED_THEN = 0, 3, 6
# columns of `Work.sticking_point`: point, normal and x-axis, and the rates of the first two
HELD_POINT, HELD_NORMAL, HELD_AXIS, POINT_RATE, NORMAL_RATE = 0, 3, 6, 9, 12
# columns of a wrench: force, torque
WRENCH_FORCE, WRENCH_TORQUE = 0, 3
# columns of `Work.block`: stiffness 3 x 3 from 0 and its turning part, then damping
TURNING_STIFFNESS, BLOCK_DAMPING, TURNING_DAMPING = 9, 10, 19
# entries of `Work.bound`: the square of the highest frequency, the highest rate of damping
HIGHEST_SQUARE, HIGHEST_DAMPING, HIGHEST_FRICTION = range(3)

# entries of `Rows.used`
USED_ROWS, USED_INCIDENTS, USED_EVENTS = range(3)

# columns of `Rows.events`
EVENT_TIME, EVENT_KIND, EVENT_ELEMENT, EVENT_SLOT = range(4)

#: Rows of `Sweep.cone`: those of stiction.cones, and three of stiction.rigid_contact.
CONE_ROWS = 12
SLOT_COLUMNS = 33
#: What `contact.memory.put_aside` keeps of a slot, and twice the memory: frames, mode, point,
#: `Work.slot`.
SPARE = 24 + SLOT_COLUMNS
#: How a friction law is asked on a rim (`contact.rims`): at its points, all round it, at a place
#: for each point; and how many numbers of a law's memory are a stretch.
AT_POINTS, AROUND_RIM, AT_PLACES = range(3)
#: `Kinds.moves`: rows are parts of a shape, so that incidents keep them; they are, and friction
#: that sticks is held along J, a plane; they are none; or they are, but what sticks is held along
#: J's face, at a place that has another row behind an edge.
AT_ROWS, ON_PLANE, NO_ROWS, HELD_AT_PLACES = range(4)
#: `Graphics.flat`: flat sides are across the shape's axes, as far out as `size`, or there are none;
#: or they are those of the polyhedron that `size` is the address of.
AXIS_SIDES, HULL_SIDES = range(2)
STRETCH = 2
# columns of `Pattern.meets`: incidences of a block's row and column, and the block; of
# `ConstraintGraph.reaction`; entries of `ConstraintGraph.cost`
MEETS_ROW, MEETS_COLUMN, MEETS_BLOCK = range(3)
REACTION_AT, REACTION_SIGN = range(2)
COST_OF_SPARSE, COST_OF_LINK = range(2)
# columns of `Rows.contact`, of each contact; force and torque take three
CONTACT_FORCE, CONTACT_TORQUE, CONTACT_DEPTH, CONTACT_SLIP = 0, 3, 6, 7
CONTACT_INCIDENTS, CONTACT_AREA, CONTACT_COLUMNS = 8, 9, 10

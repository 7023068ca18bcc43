"""What a run is given: constants, but for the fields that say otherwise."""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1, I2


@tags.constant
class Bodies(NamedTuple):
    """Moving bodies."""

    mass: F1  # (nb,) scaled so that F = m a
    inertia: F3  # (nb, 3, 3) about the cg, in cg axes
    inverse: F3  # (nb, 3, 3) its inverse


@tags.constant
class Graphics(NamedTuple):
    """Shapes that take part in contacts."""

    body: I1  # (ng,)
    p: F2  # (ng, 3) centre, in the body's cg axes
    R: F3  # (ng, 3, 3) shape axes to cg axes
    size: F2  # (ng, 4) see geometry.catalog
    radius: F1  # (ng,) radius of the ball around the centre that holds the shape; inf for a plane
    half: F2  # (ng, 3) half edges of the box in shape axes that holds the shape; inf for a plane
    turns: I1  # (ng,) 0 for a sphere, whose surface a rotation about its centre does not move
    thin: F1  # (ng,) half of the thinnest side, of meshes also of their walls; inf for a plane
    width: F1  # (ng,) half of the least width of the whole shape; inf for a plane
    shape: I1  # (ng,) class of shape, see `Broadphase.kind`
    flat: I1  # (ng,) how its flat sides are known: AXIS_SIDES or HULL_SIDES
    marker_p: F2  # (ng, 3) reference marker, in cg axes
    marker_R: F3  # (ng, 3, 3)
    surfaces: F1  # packed triangles of shapes that need them (`model.surface`), see `size`


@tags.constant
class Kinds(NamedTuple):
    """How two shapes of a contact are tested against each other."""

    contact: I1  # (nk,)
    kernel: I1  # (nk,) address, 0 where FCL does it
    slots: I1  # (nk,) points it gives at most
    swapped: I1  # (nk,) 1 where the kernel's I is the contact's J
    regroups: I1  # (nk,) 1 where points may appear deep in a contact that goes on
    whole: F1  # (nk,) shares of a flat face, where incidents have an area; else 0
    rims: I1  # (nk,) 1 where each three rows are of one rim: `contact.rims`
    step: I1  # (nk,) rows from one incident to the next: 1 for points, all where a pair is one
    moves: I1  # (nk,) whether incidents keep their slots by place: AT_ROWS, or why
    noise: F1  # (nk,) scatter of the normals that its detector gives
    bound: I1  # (nk,) address of its motion bound, 0 for none
    pressure: I1  # (nk,) 1 where the law gives a pressure over the patch, and no force


@tags.constant
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
    left: I1  # (nc,) which of them says how far it is beyond its branch, 0 for none
    spreads: I1  # (nc,) 1 where the law is asked all over a patch: `contact.spreading`
    rims: I1  # (nc,) how the law is asked on a rim, AT_POINTS, ...: `contact.rims`
    numbers: F2  # (nc, ...) of the deck, but for the laws' own: see dynamics.contact.forces
    dmax: F1  # (nc,) 0 if not given
    reads_x: I1  # (nc,) 1 where an error of X counts
    user_normal: I1  # (nc,) where `laws.user_normal` has its inputs, 0 for a built-in normal law
    rigid: I1  # (nc,) 1 where friction holds by equations: stiction.rigid_contact


@tags.constant
class Slots(NamedTuple):
    """Places for incidents."""

    pair: I1  # (ns,)
    x: I1  # (ns,) where X starts in y, -1 where it is not carried
    z: I1  # (ns,) where the law's memory starts in y, -1 where it is not integrated


@tags.constant
class Markers(NamedTuple):
    """Markers that joints, forces and expressions look at; row 0 is the global frame."""

    body: I1  # (nm,)
    p: F2  # (nm, 3) in the body's cg axes
    R: F3  # (nm, 3, 3)


@tags.constant
class Angles(NamedTuple):
    """Angles of one marker about the z-axis of another that are followed over whole turns."""

    i: I1  # (na,) markers
    j: I1  # (na,)


@tags.constant
class Curves(NamedTuple):
    """Curves on which points or curves of other bodies stay: pieces of degree 5 in a parameter u.

    On piece k, u from begin[k] on, x = sum_n coefficient[k, n] (u - begin[k])^n in J's axes. Of two
    curves that touch the first is in I's axes, the row behind it the second, in J's.
    """

    first: I1  # (curves + 1,) first piece of each
    begin: F1  # (pieces,)
    length: F1  # (pieces,) by how much u grows on it
    coefficient: F3  # (pieces, 6, 3)
    closed: I1  # (curves,) 1 where it goes on at its begin
    i: I1  # (curves,) markers: whose origin or curve is held, and in whose axes the other is given
    j: I1  # (curves,)
    equation: I1  # (curves,) the first of those that hold it
    touching: I1  # (curves,) 1 for the first of two that touch, 2 for the second; 0: holds a point
    normal: F2  # (curves, 3) of the second: unit normal of the plane, in J's axes


@tags.constant
class Surfaces(NamedTuple):
    """Surfaces on which points of other bodies stay: patches of degree 5 in u and in v.

    On a patch x = sum_nm coefficient[patch, 6 n + m] (u - begin_u)^n (v - begin_v)^m in J's axes;
    patches of a surface go on along v, then along u.
    """

    first: I1  # (surfaces + 1,) first patch of each
    start: I2  # (surfaces, 2) first span along u and along v
    spans: I2  # (surfaces, 2) how many
    begin: F1  # (spans,) of u or v
    length: F1  # (spans,)
    coefficient: F3  # (patches, 36, 3)
    closed: I2  # (surfaces, 2) 1 where it goes on at its begin
    i: I1  # (surfaces,) markers: whose origin is held, and in whose axes the surface is given
    j: I1  # (surfaces,)
    equation: I1  # (surfaces,)


@tags.constant
class Programs(NamedTuple):
    """Expressions as instructions of a stack machine."""

    start: I1  # (programs + 1,) first instruction of each
    code: I2  # (instructions, 6) operation and up to five numbers, see compile_model.programs
    number: F1  # constants
    stack: tags.Scratch[F2]  # (deepest, 3) value, first and second derivative
    quick_start: I1  # (programs + 1,) the same for values alone
    quick: I2  # (instructions, 6) with operations by a number in one, see compile_model.programs
    operand: F1  # (instructions,) the number that each of `quick` takes, if it takes one
    values: tags.Scratch[F1]  # (deepest + 1,) values alone
    level: F1  # (curves,) z of a curve of a spline
    curve: I1  # (curves + 1,) first piece of each
    piece: F2  # (pieces, 5) where it begins, and the factors of 1, s, s^2, s^3


@tags.constant
class States(NamedTuple):
    """States of the user's own."""

    program: I1  # (nz,) their slopes
    offset: I1  # (nz,) in y
    scale: F1  # (nz,) size below which an error counts as one at this size


@tags.constant
class Sensors(NamedTuple):
    """What is watched, and acted on in Python when it becomes true."""

    id: I1  # (n,)
    program: I1  # (n,)
    evaluate: I1  # (n,) program whose value SENVAL shows, -1 for none
    compare: I1  # (n,) NOT_LESS, ...
    value: F1  # (n,)
    width: F1  # (n,) how far from the value counts as there
    located: I1  # (n,) 1 where a step ends at the crossing


@tags.constant
class Switching(NamedTuple):
    """What may change its branch within a step, which then ends there: compile_model.switching."""

    program: I1  # (n,) that tells the sides of an expression's switches, -1 for a force
    force: I1  # (n,) row of `Applied`, -1 for an expression; the last may have neither: it is
    # for what all incidents do whose friction has modes
    jumps: I1  # (n,) 1 where the value of the expression may jump, not only its slope


@tags.constant
class Users(NamedTuple):
    """User subroutines of forces and variables, see expressions.subroutines."""

    address: I1  # (nu,) of their guarded C functions, 0 for a residual
    element: I1  # (nu,) row of `Residuals`, -1 for a subroutine
    result: tags.Scratch[F2]  # (nu, most) what each returned last
    failed: tags.Scratch[I1]  # (1,) code of the first hook that failed, or 0
    seen: tags.Scratch[F1]  # (ny,) y when a friction that looks at it is called; else (0,)


@tags.constant
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
    offset: I1  # (unknowns,) in y, -1 for none
    initial: F1  # (unknowns,)
    scale: F1  # (unknowns,) a usual size
    address: I1  # (n,) of the residual
    twin: I1  # (n,) of the interpreted one, which says why it fails
    interpreted: I1  # (n,) 1 where `address` enters Python
    user: I1  # (n,) row of `Users`
    par: F2  # (n, widest)
    given: tags.Scratch[F1]  # (inputs,)
    out: tags.Scratch[F1]  # (unknowns,) of one element, as all below
    base: tags.Scratch[F1]
    start: tags.Scratch[F1]
    z: tags.Scratch[F1]
    step: tags.Scratch[F1]
    size: tags.Scratch[F1]
    rows: tags.Scratch[F1]
    by: tags.Scratch[F3]  # (2, unknowns, unknowns) residual by f and by f'
    moves: tags.Scratch[F3]  # (2, unknowns, directions) residual by x and by x'
    A: tags.Scratch[F2]  # (unknowns, unknowns)
    swap: tags.Scratch[I1]
    rise: tags.Scratch[F1]
    slopes: tags.Scratch[F3]  # (3, unknowns, wide) unknowns by x, x' and states
    unsolved: tags.Scratch[I1]  # (1,) row of the element that was not solved, -1 for none


@tags.constant
class Applied(NamedTuple):
    """Forces between two markers, of the kinds of `forces.catalog`."""

    form: I1  # (nf,) LINE_FORCE, ...
    # 1 where it is settled with the reactions: friction in joints, and what looks at reactions
    # (forces.reaction_forces)
    with_reactions: I1  # (nf,)
    i: I1  # (nf,) markers
    j: I1  # (nf,)
    formula: I1  # (nf,) address of the formula of its kind (forces.abi), 0 for none
    par: F2  # (nf, widest) what that takes; of friction in joints radius, preload, arm
    bound: F2  # (nf, BOUNDS) what a step without error estimate must follow
    keeps: I1  # (nf,) 1 where it remembers a slider and a mode: `State.dry`
    program: I1  # (nf,) -1 for none
    components: I2  # (nf, 6) programs of force and torque of a vector force, -1 for none
    axes: I1  # (nf,) marker whose axes components are along, whose z an axis is
    angle: I1  # (nf,) row of `Angles`, -1 for none
    alone: I1  # (nf,) 1 where nothing acts on J
    law: I1  # (nf,) address of a normal or friction law, 0 for none
    law_par: F2  # (nf, widest)
    slopes: I1  # (nf,) address of the slopes of a wrench, 0 for none or where not asked for
    id: I1  # (nf,) of the element
    connection: I1  # (nf,) whose reaction presses, -1 for none
    equation: I1  # (nf,) that holds rigid dry friction while it sticks, -1 for none
    by_reactions: I2  # (nu, 3) settled with the reactions: row, component, program, -1 of friction


@tags.constant
class Tree(NamedTuple):
    """Bodies that constraints hold, each hung on its parent by one joint, parents first.

    A body without such a joint is a root that moves freely. The bodies of one root follow each
    other.
    """

    body: I1  # (nt,)
    parent: I1  # (nt,) tree index, -1 for ground
    of_body: I1  # (nb + 1,) tree index, -1 for none
    root: I1  # (nt,) index of the first body of its tree
    end: I1  # (nt,) one behind the last index of its tree
    turn: I1  # (nt,) what of the rotation is free: TURN_...
    slide: I2  # (nt, 3) 1 where the child may move along that axis of the parent's marker
    axis: I2  # (nt, 2) of UNIVERSAL: axis of the child's and of the parent's marker
    child_p: F2  # (nt, 3) joint marker on the child, in its cg axes
    child_R: F3  # (nt, 3, 3) turned so that it is along the parent's where the joint holds it
    parent_p: F2  # (nt, 3)
    parent_R: F3  # (nt, 3, 3)
    free: I1  # (nt,) number of free directions


@tags.constant
class Equations(NamedTuple):
    """Constraint equations that the tree does not hold by itself: loops, motions, couplers.

    An equation is a sum of terms, less a function, = 0; see constraints.equations.
    """

    first: I1  # (ne + 1,) first term of each
    program: I1  # (ne,) function of TIME or the state, or a whole general constraint; -1 for none
    level: I1  # (ne,) 2 holds displacements, 1 velocities, 0 accelerations
    general: I1  # (ne,) WHOLE where the program is the whole equation, OF_STATE where a motion
    # depends on the state; terms of the program stand behind the motion's own
    user: I1  # (ne,) 1 + row of `Users` whose relation of the terms it is, 0 for their sum
    constant: F1  # (ne,)
    start: F2  # (ne, 2) sum and its rate that assembly brings about where no level does; or NaN
    unit: F1  # (ne,) what a residual is measured by: L, or 1 for angles
    connection: I1  # (ne,) the element that it belongs to
    dry: I1  # (ne,) row of `Applied` that it holds while that sticks, -1 for any other
    off: I1  # (ne,) 1 while its element takes no part
    slot: I1  # (ne,) slot that it holds along x or y while that sticks, -1 for any other
    kind: I1  # (terms,)
    i: I1  # (terms,) markers
    j: I1  # (terms,)
    # (terms, 2) of I and of J; of TOUCHING 0 or 1 for x or y, and the slot; of a higher
    # pair which of its equations, and its kind
    axis: I2
    factor: F1  # (terms,)
    angle: I1  # (terms,) row of `Angles`, of a higher pair of `Curves`, `Surfaces`, -1 for none
    active: tags.State[I1]  # (ne + 1,) equations in use, ascending, their number last


@tags.constant
class Connections(NamedTuple):
    """Elements with reactions: joints, primitives, couplers, motions, general constraints."""

    i: I1  # (nj,) markers
    j: I1  # (nj,)
    tree: I1  # (nj,) tree index, -1 where equations hold it
    flip: I1  # (nj,) 1 where I is on the parent


@tags.constant
class World(NamedTuple):
    """What belongs to no element."""

    gravity: F1  # (3,) what of it is constant
    weight: I2  # (1 + .., 3) programs of components that are expressions, -1 for none: those in
    # force, then those of every gravity of the model
    scale: F1  # (4,) length L, speed V and energy of the whole model, for difference quotients and
    # what is rounding, and the tolerance; errors are judged by `Scales`
    hooks: I1  # (hooks,) addresses of what only some scenes need: `arrays.hooks`
    fixed_step: I1  # (1,) 1 for a method without error estimate
    # (1,) WITHIN while a point of the last step is evaluated, REPLAYED while a row is
    past: tags.Scratch[I1]
    accumulators: (
        I1  # (2,) where in y the work of motions and the damped energy stand, -1 for nowhere
    )


@tags.constant
class Scales(NamedTuple):
    """What errors of n groups of connected bodies are judged by: `compile_model.groups`."""

    group: I1  # (nb,) of a body
    length: F1  # (n,) L
    speed: F1  # (n,) the least V, weight left out
    mass: F1  # (n,) of the heaviest body
    of_contact: I1  # (nc,) group by which a contact's energy is judged
    gyration: F1  # (nb,) radius

"""Arrays of nonsmooth time stepping, made only where a run steps so.

Counts: nb bodies (row nb is ground), nc contacts, m contact points that a step may have. Velocities
and wrenches are spatial vectors (linear, angular about the cg), global axes. r is an impulse along
(n, x, y) of a contact point, on I; u = H v the velocity of I relative to J there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbsim.arrays.codes import AT_ONCE
from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1, I2

# entries of `Rules.number`, of each contact: slip speed up to which it sticks, coefficient
# where it sticks, restitution, closing speed below which there is none, 1 where the coefficient
# jumps as what sticks yields
FIRST_SPEED, STICKING, RESTITUTION, SLOWEST, DROPS = range(5)
RULE_NUMBERS = 5
# entries of `Kept.table`: a contact point of the last step that was taken; force is on I's body
(
    KEPT_CONTACT,
    KEPT_SLOT,
    KEPT_BODY_I,  # in the contact's order, as all that follows
    KEPT_BODY_J,
    KEPT_GAP,  # at the step's begin
    KEPT_CLOSING,  # speed before it
    KEPT_SLIP,  # behind it
    KEPT_STICKS,  # 1 where the pair's friction is less than it may be
    KEPT_ROW,
    KEPT_STAYS,  # 1 where a point of the step at hand is the same one
    KEPT_HIT_I,  # 1 where an impact was part of the force, and I did not go on as if nothing hit it
    KEPT_HIT_J,
) = range(12)
KEPT_POINT, KEPT_NORMAL, KEPT_TANGENT, KEPT_FORCE = 12, 15, 18, 21
# from the cg of I, then J
KEPT_ARMS = 24
KEPT_COLUMNS = 30
# of `Points.was`: no such row; nor that, but points of its pair that stuck
NOT_KEPT, BESIDE_STUCK = -1, -2
# entries of `Plan.number`: 1 where the error of steps is not estimated; 1 where some kind of pair
# is not near; part of a step's jumps that the solver may leave; 1 where bodies at rest may sleep;
# the tolerance
FIXED, SOME_AHEAD, LEFT_PART, MAY_SLEEP, TOL = range(5)
PLAN_NUMBERS = 5
# columns of `Plan.scale`: L; V, also how fast positions are projected (`solver.project_positions`);
# the group's own time L/V; the length below which gaps and changes of position do not count; how
# far closing and slipping may go in a step and are none; what the solver may leave of a velocity,
# times h; and at most, however short a step; how near to where friction yields a step is to end
LENGTH, SPEED, OWN_TIME, SLOP, NOISE, LEFT, LEFT_SPEED, NEAR = range(8)
PLAN_SCALES = 8
# entries of `Tally.number`, of the last step tried: what the solver left, as a velocity, and what
# it may; its length; the contact that closed fastest in it, and by how much within its length; how
# far its end is from that of two halves; 1 where velocities jump in it or in either of two halves;
# the energy that it leaves open by the way it moves bodies on (`energy.left_open`)
RESIDUAL, MAY_BE_LEFT, STEP_LENGTH, FASTEST, CLOSED, END_OFF, HIT, LEFT_OPEN = range(8)
TALLY_NUMBERS = 8
# entries of `Points.given`: axes n, x, z; a x axis for I's arm a, then J's; I^-1 of these, as each
# body's inertia is; inverse masses of I and J; u by r, a symmetric matrix; its inverse, row by row
# from the diagonal on, 0 where it has none; 1/W_nn, and W_nx, W_nz over W_nn; of x, z what of W is
# left where n is held; how many directions of the plane of contact joints hold then; such a one; by
# how much u along these is off at the step's end, see `one_point.fill_drift`
AXES, TURN, SPIN, LIGHT = 0, 9, 27, 45
W_NN, W_NX, W_NZ, W_XX, W_XZ, W_ZZ, STOPS, ALONG, SCHUR = 47, 48, 49, 50, 51, 52, 53, 59, 62
HELD, HELD_ALONG, DRIFT = 65, 66, 68
GIVEN = 70
# entries of `Rest.body`: 1 where a body sleeps; its island then; steps for which it was still; 1
# where nothing of the island of which it is the first moves; of `Rest.count`: how many sleep, 1
# where some were woken in the step at hand, see below; of `Kept.count`, behind how many there are:
# of what sleeps
ASLEEP, ISLAND, CALM_STEPS, QUIET = range(4)
# and in which others sleep than in the step before; how many near pairs stand before those of which
# something is awake, 0 where they are not sorted so; 1 where the table of what does not move is
# filled; how many pairs are listed, and those for good among them
SLEEPERS, WOKEN, CHANGED, ASIDE, GRID, LISTED_PAIRS, LISTED_FIXED = range(7)
REST_COUNTS = 7
# bits of `Rest.side`
OF_I, OF_J = 1, 2
SLEEPING_ROWS = 1
# entries of `Tally.load`: of the step tried last, its first half and its second; 1 where friction
# yields at the begin of the step at hand, as far as is known; else how long after that, as the last
# step saw it
OF_WHOLE, OF_FIRST, OF_SECOND, DUE, AHEAD = range(5)
LOADS = 5
# entries of `Tally.count`: contact points, points that press, sweeps so far, steps tried so far,
# steps that were left unsolved, steps with positions projected, Newton iterations so far, points
# so far, steps of the deck's length that were compared with two halves, bodies that steps went
# through so far, solutions for what impulses do to held bodies so far
POINTS, PRESSING, ALL_SWEEPS, ALL_STEPS, UNSOLVED, PROJECTED, NEWTONS, ALL_POINTS = range(8)
COMPARED, ALL_BODIES, ALL_ANSWERS = 8, 9, 10
TALLY_COUNTS = 11


# entries of `Plan.force`: addresses of what linearises, factors and solves, 0 where forces are
# explicit; of `Forces.number`: the part of the step at which forces are taken, and how stiff they
# are, as the rate of a damper
LINEARISE, FACTOR, SOLVE = range(3)
THETA, STIFFNESS = range(2)


@tags.constant
class Rules(NamedTuple):
    """What a Force_Contact says of rigid contact."""

    number: F2  # (nc, RULE_NUMBERS)
    first: I1  # (nc + 1,) of each contact's knots
    knots: F2  # (all, 2) slip speeds and the coefficients of friction there; straight in between


@tags.constant
class Plan(NamedTuple):
    """What holds for a whole run."""

    number: F1  # (PLAN_NUMBERS,)
    scale: F2  # (n, PLAN_SCALES) of each group of connected bodies: `compile_model.groups`
    connected: I1  # (nb + 1,) group of a body, 0 of ground
    of_contact: I1  # (nc,) group by which a contact is judged
    near: I1  # (nk,) 1 where rows of a kind of pair that are apart are points of contact
    rows: I1  # (nk,) rows of a kind of pair, from its first slot on
    # (nb + 1,) of bodies that joints hold together or forces couple, -1 for free ones and ground
    group: I1
    members: I1  # (nb,) those bodies, group by group
    place: I1  # (nb + 1,) of a body within its group
    first: I1  # (groups + 1,) of each group's
    force: I1  # (3,) how forces are implicit, see `implicit`


@tags.scratch
class Motion(NamedTuple):
    """Bodies in a step."""

    inverse: F3  # (nb, 6, 6) of the mass
    before: F2  # (nb + 1, 6) velocity at the step's begin
    free: F2  # (nb + 1, 6) at its end, were there no contacts
    carried: F2  # (nb + 1, 6) of `free - before`, what contacts take off it, see `carried`
    known: I1  # (1,) 1 where that is known of bodies that joints or forces hold, or is nothing
    flight: F2  # (nb + 1, 6) at the step's end, if nothing but these contacts presses
    v: F2  # (nb + 1, 6) with them
    still: I1  # (1,) points of islands that go nowhere
    costs: F1  # (2,) points that press, and seconds of Newton's iteration with as many, `solver`
    guess: F2  # (nb, 6) as the last solution of the step had it, by which forces are
    full: F2  # (nb + 1, 6) with all rebound, see `rebound`
    work: F2  # (nb, 4) of contacts of the island of which a body is the first
    shift: F2  # (nb + 1, 6) displacement over the step's length
    changed: I1  # (nb + 1,) the sweep that changed a body's velocity last by what counts
    goes_on: I1  # (nb + 1,) 1 of bodies that go on as if nothing hit them; of ground
    part: F1  # (nb + 1,) of `before` in that, the rest being v's
    touch: F1  # (nb + 1,) part of the step at which a body first meets something that turns it
    spins: F1  # (nb,) kinetic energy of a spin as impulses make it, see `energy`
    flies: F1  # (nb + 1,) whether it flies before that and behind, see `displacements`
    reach: F1  # (ng,) how far a graphic may come in the step
    went: F1  # (ng,) how far it goes by what impulses give
    slope: F1  # (ny,) y'
    way: F2  # (2, 6) velocities of the bodies of a pair that is moved ahead
    frames: F2  # (2, 12) of its graphics at the step's begin
    pressed: I1  # (nb + 1,) the try of a step before which a body pressed on one that moves
    push: F1  # (3,) way back by which its first graphic is put into the other one there
    taken: I1  # (pairs + 1,) the try of a step in which a pair has points by that; last: this one
    measured: I1  # (pairs,) 1 + list of near pairs in which its rows were measured, 0: none
    impulse: F1  # (ny,) impulses on bodies, then what they change of velocities
    columns: F3  # (nb, 6, AT_ONCE) impulses on a tree's bodies, then what they change, see `held`
    shares: F3  # (nb, 6, AT_ONCE) of joints in them
    loaded: I1  # (nb,) 1 where there are such impulses, by tree indices
    listed: I1  # (nb,) first point of a tree, by tree indices of roots
    batch: I1  # (AT_ONCE // 3,) points at hand
    middle: F1  # (ny,) state within a step at which forces are found
    midst: F1  # (ny,) state in the midst of a step at which joints hold, see `forces`
    aside: F1  # (ny,) that, bodies moved along what an impact does to their ways
    half: F2  # (2, ny) states of a step's two halves, where it is compared with them


@tags.scratch
class Points(NamedTuple):
    """Contact points that a step looks at, in the order of their slots."""

    slot: I1  # (m,)
    contact: I1  # (m,)
    body: I2  # (m, 2) I's and J's
    key: I1  # (m,) of its pair of graphics, whose points follow each other
    row: I1  # (m,) of the pair
    was: I1  # (m,) row of `Kept` that is the same point; NOT_KEPT, BESIDE_STUCK for none
    gap: F1  # (m,)
    slop: F1  # (m,) depth at which a step may leave it, see `points.slop_of`
    point: F2  # (m, 3)
    arm: F3  # (m, 2, 3) from the bodies' cg, when the point touches
    normal: F2  # (m, 3)
    tangent: F2  # (m, 3)
    given: F2  # (m, GIVEN) what the solver reads of the point, see above
    wide: I1  # (m,) else first row of `moved`, -1 where they do not
    many: I1  # (m,) its rows there
    near: I1  # (m,) the first ones of them, of bodies that have points themselves
    moved: I1  # (wide rows,) bodies that r moves
    moves: F3  # (wide rows, 3, 6) their velocities by components of r
    listed: I2  # (m, 2) next point of the trees of its bodies, see `held.list_by_trees`
    touches: I1  # (nb,) points of a body that joints or forces hold, see `held`
    answer: I1  # (nb,) first row of `answers` for wrenches on it, -1 for none
    answered: I1  # (1,) rows of `answers` in use
    answers: F3  # (wide rows, 6, 6) velocities of the bodies of its group by a wrench's components
    mu: F1  # (m,)
    holds: F1  # (m,) mu as it is at the step's begin
    slides: F1  # (m,) s of `one_point.slip_of` as found last, 0 for none
    ahead: F1  # (m,) u_n + ahead >= 0 where the point closes
    part: F1  # (m,) of the step before an impact with restitution
    held: I1  # (m,) whether others keep the bodies from that impact, see `impacts`
    closing: F1  # (m,) u_n before the step
    r: F2  # (m, 3)
    full: F2  # (m, 3) with all rebound, see `rebound`
    old: F2  # (m, 3) r before the sweep at hand
    way: F2  # (m, 3) of the sweeps so far
    speed: F1  # (m,) V of its group
    least: F1  # (m,) what the solver may leave of its velocity, see `scales.left_of`
    counts: F1  # (m,) 1 over what may be left of its velocity
    push: F1  # (m,) what projected positions


@tags.state
class Kept(NamedTuple):
    """Contact points that pressed in the last step that was taken."""

    count: I1  # type: ignore[assignment]  # (2,) how many, and of what sleeps, which come first
    key: I1  # (m,)
    table: F2  # (m, KEPT_COLUMNS)
    spare_key: tags.Scratch[I1]  # (m,) what `sleep.put_sleepers_first` puts aside
    spare: tags.Scratch[F2]  # (m, KEPT_COLUMNS)
    table_of_keys: tags.Scratch[I1]  # (2^k,) of the hash table of keys: 1 + first row, 0 for none


@tags.state
class Tally(NamedTuple):
    """What is counted, and what the last step left unsolved."""

    number: F1  # (TALLY_NUMBERS,)
    count: I1  # type: ignore[assignment]  # (TALLY_COUNTS,)
    load: F2  # (nc, LOADS) friction of pairs that stick over the most it may be
    grounded: I1  # (groups,) 1 where ground pressed on a group of bodies since the last sample
    deepest: F1  # (nc,) depth of each contact at the begins of the parts of the step tried last


@tags.state
class Forces(NamedTuple):
    """What implicit forces have, see `implicit`; no numbers where they are explicit."""

    number: F1  # (2,)
    stiffest: F1  # (ny,) a motion that turns to the stiffest one
    coefficients: tags.Scratch[F1]  # (4,) of the linear systems
    given: tags.Scratch[F1]  # (ny,) right side of one
    found: tags.Scratch[F1]  # (ny,) its solution
    slope: tags.Scratch[F1]  # (nz,) of the user's states, over the step


@tags.state
class Rest(NamedTuple):
    """Which bodies sleep, or may soon: see `stepping.sleep`."""

    body: I2  # (nb, 4)
    since: F1  # (nb,) when a body that is still became so
    count: I1  # type: ignore[assignment]  # hides a method of tuples; (REST_COUNTS,)
    net: F2  # (nc, 3) force of each contact between what sleeps
    grounded: I1  # (groups,) 1 where ground presses on a body of a group that sleeps
    parent: tags.Scratch[I1]  # (nb,) an earlier body of the same island
    pair: tags.Scratch[I1]  # (pairs,) near pairs of which something is awake, see `awake`
    # (ng, 1 + large contacts) 1 for members of some, then whether of I, of J: see `near_pairs`
    side: tags.Constant[I2]
    still: tags.Scratch[I1]  # (2^k,) first member of a cell that does not move, -1 for none
    moving: tags.Scratch[I1]  # (2^k,) the same of those that are awake
    next: tags.Scratch[I1]  # (ng,) next one of the same cell
    giants: tags.Scratch[I1]  # (ng + 1,) how many do not move and fit into no cell, then these
    width: tags.Scratch[F1]  # (1,) of a cell


class Stepping(NamedTuple):
    """All of it."""

    rules: Rules
    plan: Plan
    motion: Motion
    points: Points
    kept: Kept
    tally: Tally
    rest: Rest
    forces: Forces


def whole(*shape: int) -> np.ndarray:
    """Return whole numbers, all 0."""
    return np.zeros(shape, dtype=np.int64)


def numbers(*shape: int) -> np.ndarray:
    """Return numbers, all 0."""
    return np.zeros(shape)


def at_rest(nb: int, nc: int, pairs: int, groups: int, side: I2) -> Rest:
    """Return arrays for bodies of which none sleeps."""
    ng = len(side)
    room = 1 << max(4, int(2 * ng).bit_length())
    return Rest(
        body=whole(nb, 4),
        since=np.zeros(nb),
        count=whole(REST_COUNTS),
        net=np.zeros((nc, 3)),
        grounded=whole(groups),
        parent=whole(nb),
        pair=whole(pairs),
        side=side,
        still=whole(room),
        moving=whole(room),
        next=whole(ng),
        giants=whole(ng + 1),
        width=np.zeros(1),
    )


def no_points(m: int, nb: int, wide: int) -> Points:
    """Return empty arrays for m contact points of nb bodies, with so many wide rows."""
    return Points(
        slot=whole(m),
        contact=whole(m),
        body=whole(m, 2),
        key=whole(m),
        row=whole(m),
        was=whole(m),
        gap=numbers(m),
        slop=numbers(m),
        point=numbers(m, 3),
        arm=numbers(m, 2, 3),
        normal=numbers(m, 3),
        tangent=numbers(m, 3),
        given=numbers(m, GIVEN),
        wide=whole(m),
        many=whole(m),
        near=whole(m),
        moved=whole(wide),
        moves=numbers(wide, 3, 6),
        listed=whole(m, 2),
        touches=whole(nb),
        answer=whole(nb),
        answered=whole(1),
        answers=numbers(wide, 6, 6),
        mu=numbers(m),
        holds=numbers(m),
        slides=numbers(m),
        ahead=numbers(m),
        part=numbers(m),
        held=whole(m),
        closing=numbers(m),
        r=numbers(m, 3),
        full=numbers(m, 3),
        old=numbers(m, 3),
        way=numbers(m, 3),
        speed=numbers(m),
        least=numbers(m),
        counts=numbers(m),
        push=numbers(m),
    )


def implicit_forces(n: int, nz: int) -> Forces:
    """Return empty arrays for n numbers of y and the user's states: what is not known is stiff."""
    number = np.array([1.0, math.inf])
    y = [np.zeros(n) for _ in range(3)]
    return Forces(number, y[0], np.zeros(4), y[1], y[2], np.zeros(nz))


def make(
    rules: Rules, plan: Plan, side: I2, sizes: tuple[int, int, int, int, int, int, int, int]
) -> Stepping:
    """Return empty arrays.

    `sizes` are the numbers of bodies, graphics, numbers of y, contact points, pairs, wide rows,
    groups of bodies, the user's states; `side` is that of `Rest`.
    """
    nb, ng, ny, m, pairs, wide, groups, nz = sizes

    held = nb if len(plan.members) > 0 else 0
    motion = Motion(
        inverse=numbers(nb, 6, 6),
        before=numbers(nb + 1, 6),
        free=numbers(nb + 1, 6),
        carried=numbers(nb + 1, 6),
        known=whole(1),
        flight=numbers(nb + 1, 6),
        v=numbers(nb + 1, 6),
        guess=numbers(nb, 6),
        full=numbers(nb + 1, 6),
        work=numbers(nb, 4),
        shift=numbers(nb + 1, 6),
        changed=whole(nb + 1),
        goes_on=whole(nb + 1),
        part=numbers(nb + 1),
        touch=numbers(nb + 1),
        spins=numbers(nb),
        flies=numbers(nb + 1),
        reach=numbers(ng),
        went=numbers(ng),
        slope=numbers(ny),
        way=numbers(2, 6),
        frames=numbers(2, 12),
        pressed=whole(nb + 1),
        push=numbers(3),
        taken=whole(pairs + 1),
        measured=whole(pairs),
        impulse=numbers(ny),
        columns=numbers(held, 6, AT_ONCE),
        shares=numbers(held, 6, AT_ONCE),
        loaded=whole(held),
        listed=whole(held),
        batch=whole(AT_ONCE // 3),
        still=whole(1),
        costs=numbers(2),
        middle=numbers(ny),
        midst=numbers(ny),
        aside=numbers(ny),
        half=numbers(2, ny),
    )
    points = no_points(m, nb, wide)
    room = 1 << max(4, int(4 * m - 1).bit_length())
    table, spare = numbers(m, KEPT_COLUMNS), numbers(m, KEPT_COLUMNS)
    kept = Kept(whole(2), whole(m), table, whole(m), spare, whole(room))
    nc = len(rules.number)
    rest = at_rest(nb, nc, pairs, groups, side)
    tally = Tally(
        np.zeros(TALLY_NUMBERS), whole(TALLY_COUNTS), numbers(nc, LOADS), whole(groups), numbers(nc)
    )
    tally.load[:, DUE] = 1.0
    forces = implicit_forces(ny if plan.force[LINEARISE] != 0 else 0, nz)
    return Stepping(rules, plan, motion, points, kept, tally, rest, forces)

"""What goes on from step to step beside y, and so is in a checkpoint; fields say what is not."""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1, I2


@tags.state
class Pairs(NamedTuple):
    """Graphics that may touch, in the order that their kernel wants."""

    kind: I1  # (np,)
    graphic_i: I1  # (np,) the kernel's I
    graphic_j: I1  # (np,)
    slot: tags.Constant[I1]  # (np,) first slot
    last: tags.Constant[I1]  # (np,) one behind the last slot
    touches: I1  # (np,) slots that touched at the committed state
    gap: F1  # (np,) distance that the pair kept when last measured
    left: F1  # (np,) what the motion since has left of it for certain
    active: I1  # (np,) rows in use, ascending; those of large contacts behind all others
    free: I1  # (np,) rows not in use, the next one last
    # named as a method of tuples, which nobody asks of arrays
    count: I1  # type: ignore[assignment]  # (4,) live, free, live for good, rows a listing lacked


@tags.state
class Broadphase(NamedTuple):
    """Contacts of many graphics, whose near pairs are found as they move."""

    contact: tags.Constant[I1]  # (large contacts,)
    same: tags.Constant[
        I1
    ]  # (large contacts,) 1 where I and J are one set: each pair once, no body's own
    first: tags.Constant[
        I2
    ]  # (large contacts, 4) begin and end of I in `member`, begin and end of J
    member: tags.Constant[I1]  # graphics
    kind: tags.Constant[
        I2
    ]  # (large contacts, shapes^2) kind by shape class of I and of J, -1 for none
    swap: tags.Constant[I2]  # (large contacts, shapes^2) 1 where the kernel wants the other order
    size: F1  # (2,) a pair is near if its boxes are nearer than the first; a usual reach
    #: (ng, 7) centre and quaternion of the body, of a plane its normal, when pairs were last listed
    reference: F2
    lever: F1  # (ng,) of a plane that moves: from its marker to a usual member
    room: (
        F1  # (ng,) how far any point may still move before that; inf for who is in no large contact
    )
    own: F1  # (ng,) what a fast one may move by itself, where that is more than half of `size`
    box: tags.Scratch[F2]  # (ng, 6) lower and upper corner when pairs are listed
    cell: tags.Scratch[I1]  # (ng,) of the grid
    order: tags.Scratch[I1]  # (ng,) members cell by cell
    start: tags.Scratch[I1]  # (cells + 1,) where a cell begins in `order`
    head: tags.Scratch[I1]  # (ng,) first row of a pair whose I is this graphic, -1 for none
    next: tags.Scratch[I1]  # (np,) next row of the same I
    moved: tags.Scratch[I2]  # (np, 5) new row of a pair, and its kind, graphics and touches
    spare: tags.Scratch[F2]  # (ns, SPARE) what is moved with the slots that touch


@tags.state
class State(NamedTuple):
    """The physical state beside y: the incident table, and where everything was."""

    q: F2  # (nb + 1, 4) quaternions at the committed state
    w: F2  # (nb + 1, 3) angular velocities at the committed state, global frame
    since: F1  # (1,) time of the committed state
    centre: F2  # (ng, 3) centres of the graphics at the committed state
    angle: F1  # (na,) at the committed state, whole turns included
    along: F1  # (curves + 2 surfaces,) parameters of where higher pairs touch
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
    sensed: F2  # (sensors, 5) see codes
    sides: F2  # (switches, 2) side at the committed state, how often it changed of late
    frozen: I1  # (1,) 1 where friction keeps its modes within a step, which ends where one changes
    dry: F2  # (nf, 4) of dry friction, see codes
    residual: F3  # (elements, 2, 1 + axes + 2 unknowns) time, x, f and f' at the committed state,
    # and at the begin of the last step
    fastest: F1  # (n,) what the largest speed so far of a group counts: bodies.scales
    chattering: F1  # (4,) of contacts whose friction is rigid: as of sides, 1 where one asked for
    # another mode since the committed state; of all: how many changed it: see events.switching


@tags.scratch
class Awake(NamedTuple):
    """What a step goes through where bodies sleep (`stepping.awake`); else it is everything."""

    # (2,) LISTED, or else it is everything; how many rows of `part`: the running method's own
    whole: tags.State[I1]
    part: I2  # (nb + 1, 2) begin and end of numbers of y that do not belong to what sleeps
    count: I1  # type: ignore[assignment]  # hides a method of tuples; (2,) bodies and graphics
    body: I1  # (nb,) that do not sleep, ascending
    graphic: I1  # (ng,) theirs
    loadable: tags.Constant[I1]  # bodies on which applied forces may act, asleep or not
    rest: F2  # (groups, 5) of what sleeps: mass, its centre, sum of masses times way from there
    potential: F1  # (1,) energy of what sleeps


@tags.state
class Log(NamedTuple):
    """What is counted and watched over all steps."""

    contacts: F2  # (nc, LOG_COLUMNS)
    counters: I1  # (COUNTERS,)
    rejections: I2  # (nc + 1, 4)
    ends: F3  # (2, nc, 4) force, depth, slip and closing rate at the last two ends of steps
    end_times: F1  # (2,) when that was
    samples: tags.Scratch[F3]  # (looks, nc, 4) the same within the last step
    parts: tags.Scratch[F1]  # (looks,) at which part of it: see contact.peaks
    sampled: tags.Scratch[I1]  # (1,) number of samples
    span: tags.Scratch[F1]  # (1,) length of the step


@tags.state
class Audit(NamedTuple):
    """What a run judges itself by, see pipeline.audit."""

    tied: tags.Constant[I1]  # (groups,) of `Scales`: 1 where not only contacts tie it to ground
    cone: tags.Constant[F1]  # (nc,) largest friction over normal force, inf where the law has none
    plan: tags.Constant[F1]  # (3,) see codes, as for all here
    tally: F1  # (TALLIES,)
    momentum: F2  # (groups, 7) linear 3, angular 3, 1 where ground touched it; of the last sample
    sums: tags.Scratch[F2]  # (groups, 13) see pipeline.audit
    first: tags.Constant[I1]  # (groups,) first body of each
    contact: F2  # (nc + 1, 4) change of balance while this contact pressed hardest (last row: none
    # touched), the largest of one sample, and when; largest mu N
    energy: F1  # (4,) as of `Rows.energy`
    friction_at: tags.Constant[I1]  # (nc,) where in y work of friction stands, -1 where is none
    keeps: tags.Constant[I1]  # (nc,) 1 where friction can give back what it took: by memory or X
    resists: tags.Constant[I1]  # (nf,) 1 of friction in a joint and dry friction
    friction: F2  # (nc, 3) see codes
    given: F1  # (nf,) energy that friction in a joint, or dry friction, gave
    found: F2  # (AUDITS, 4)

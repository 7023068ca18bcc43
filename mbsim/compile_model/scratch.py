"""What is empty when a run begins: state, log, scratch and the tables of output rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Graphics, Residuals
from mbsim.arrays.scratch import Rows, Sweep, Work
from mbsim.arrays.state import Awake, Log, State
from mbsim.compile_model.mechanism import Mechanism
from mbsim.core.problem import WHOLE
from mbsim.geometry.catalog import POINT
from mbsim.geometry.motion import MOTION
from mbsim.laws import abi

#: Output rows before Python takes them: so many at least, and more where they are short.
ROWS, MOST_ROWS, ROWS_BYTES = 256, 2048, 1 << 19
EVENTS = 1024
INCIDENTS = 100_000


@dataclass(frozen=True)
class Sizes:
    """How many there are of what tables hold."""

    y: int
    bodies: int  # moving ones
    pairs: int
    slots: int
    contacts: int
    connections: int
    forces: int
    by_reactions: int  # forces that depend on reactions
    sensors: int
    sliders: int  # forces that remember
    switching: int  # programs with branches
    values: int  # columns of requests
    memory: int  # most numbers that a law of a contact remembers
    looked: int  # numbers of y where modes are told apart, else 0
    ahead: int  # numbers of y where rates of normal forces are looked for, else 0
    points: int  # most candidates of a pair where friction of contacts is rigid, else 0
    groups: int  # of connected bodies
    region: int  # columns of an incident for many points


def start_state(
    n: Sizes,
    graphics: Graphics,
    angle: np.ndarray[Any, Any],
    along: np.ndarray[Any, Any],
    residuals: Residuals,
) -> State:
    """Return the incident table before anything touched."""
    nb, ng, ns, memory = n.bodies, len(graphics.body), n.slots, n.memory
    dry = np.zeros((n.forces, 4))
    # what slides begins without force where the first committed state is
    dry[:, [codes.SLIDER, codes.SLIDER_BEFORE]] = np.nan
    sensed = np.zeros((n.sensors, 5))
    sensed[:, codes.EXCESS] = np.nan
    q = np.zeros((nb + 1, 4))
    q[:, 0] = 1.0
    return State(
        q=q,
        w=np.zeros((nb + 1, 3)),
        since=np.zeros(1),
        centre=np.zeros((ng, 3)),
        angle=angle,
        along=along,
        touching=np.zeros(ns, dtype=np.int64),
        p=np.zeros((ns, 3)),
        n=np.zeros((ns, 3)),
        t=np.zeros((ns, 3)),
        depth=np.zeros(ns),
        rate=np.zeros(ns),
        normal=np.zeros(ns),
        memory=np.zeros((ns, memory)),
        before=np.zeros((ns, memory)),
        mode=np.zeros(ns),
        hit=np.zeros(ns + 1, dtype=np.int64),
        sensed=sensed,
        sides=np.zeros((n.switching, 2)),
        frozen=np.zeros(1, dtype=np.int64),
        dry=dry,
        # no time: nothing is remembered yet
        residual=np.full((len(residuals.id), 2, len(residuals.given)), np.nan),
        fastest=np.zeros(n.groups),
        chattering=np.zeros(4),
    )


def awake(n: Sizes, graphics: Graphics, loadable: np.ndarray[Any, Any]) -> Awake:
    """Return what a step goes through before anything sleeps: everything."""
    nb, ng = n.bodies, len(graphics.body)
    return Awake(
        whole=np.array([WHOLE, 0]),
        part=np.zeros((nb + 1, 2), dtype=np.int64),
        count=np.zeros(2, dtype=np.int64),
        body=np.zeros(nb, dtype=np.int64),
        graphic=np.zeros(ng, dtype=np.int64),
        loadable=loadable,
        rest=np.zeros((n.groups, 5)),
        potential=np.zeros(1),
    )


def empty_log(nc: int) -> Log:
    """Return empty counters and peaks."""
    contacts = np.zeros((nc, codes.LOG_COLUMNS))
    contacts[:, codes.FIRST_TOUCH] = np.nan
    contacts[:, [codes.BEYOND_TIME, codes.BEYOND_I, codes.BEYOND_J]] = np.nan
    contacts[:, codes.REBOUND] = np.nan
    contacts[:, codes.PEAK_FORCE_TIME] = np.nan
    return Log(
        contacts,
        np.zeros(codes.COUNTERS, dtype=np.int64),
        np.zeros((nc + 1, 4), dtype=np.int64),
        ends=np.zeros((2, nc, codes.SAMPLE_COLUMNS)),
        end_times=np.full(2, np.nan),
        samples=np.zeros((codes.SAMPLES, nc, codes.SAMPLE_COLUMNS)),
        parts=np.zeros(codes.SAMPLES),
        sampled=np.zeros(1, dtype=np.int64),
        span=np.zeros(1),
    )


def place_fixed(work: Work, graphics: Graphics) -> None:
    """Fill what no evaluation fills: rows of ground, of shapes on it, and the axes of spheres."""
    work.R[-1] = np.eye(3)
    work.v[-1] = work.w[-1] = 0.0
    fixed = graphics.body == len(work.R) - 1
    work.frames[fixed] = np.hstack([graphics.p, graphics.R.reshape(-1, 9)])[fixed]
    # nobody turns a sphere
    work.frames[graphics.turns == 0, 3:] = np.eye(3).ravel()
    work.travel[fixed] = 0.0
    work.speed[fixed] = 0.0


def scratch(n: Sizes, graphics: Graphics) -> Work:
    """Return scratch, with what stands still in its place."""
    nb, ns, nf, memory, points = n.bodies, n.slots, n.forces, n.memory, n.points
    ng = len(graphics.body)
    work = Work(
        R=np.full((nb + 1, 3, 3), np.nan),
        v=np.full((nb + 1, 3), np.nan),
        w=np.full((nb + 1, 3), np.nan),
        force=np.full((nb + 1, 3), np.nan),
        torque=np.full((nb + 1, 3), np.nan),
        noise=np.zeros((nb + 1, 2)),
        frames=np.full((ng, 12), np.nan),
        travel=np.full(ng, np.nan),
        approach=np.full(MOTION, np.nan),
        speed=np.full((ng, 2), np.nan),
        points=np.zeros((ns, POINT)),
        touching=np.zeros(ns, dtype=np.int64),
        beyond=np.zeros(n.contacts, dtype=np.int64),
        hit=np.zeros(ns + 1, dtype=np.int64),
        t=np.zeros((ns, 3)),
        slot=np.zeros((ns, codes.SLOT_COLUMNS)),
        memory=np.zeros((ns, memory)),
        kept=np.zeros((ns if n.ahead else 0, 3 + memory)),
        friction_slope=np.zeros((ns, 4)),
        fcl=np.zeros(max(1, n.pairs), dtype=np.int64),
        net=np.zeros((n.contacts, 3)),
        block=np.zeros((nb, 20)),
        bound=np.zeros(3),
        best=np.zeros(4),
        idle=np.zeros(n.looked),
        ahead=np.zeros((2 if n.ahead else 0, n.ahead)),
        law_in=np.zeros(abi.FRICTION_INPUTS + memory),
        law_out=np.zeros(abi.MEMORY_OUT + 2 * memory),
        applied=np.zeros((nf, 8)),
        motion=np.zeros(12),
        wrench=np.zeros(8),
        slopes=np.zeros((12, 6)),
        joint_friction=np.zeros((nf, 9)),
        by_reactions=np.zeros((n.by_reactions, 5)),
        secant=np.zeros((n.by_reactions, n.by_reactions)),
        reaction=np.zeros(6 * n.connections),
        squares=np.full(n.groups, np.nan),
        diagnostics=np.full(2, -1, dtype=np.int64),
        sticking_point=np.zeros((ns if points else 0, 15)),
        sticking_force=np.zeros((ns if points else 0, 2)),
        look=np.zeros((3, points, POINT)),
    )
    place_fixed(work, graphics)
    return work


def with_points(rows: Rows) -> Rows:
    """Return the tables with room for force and slip of every incident."""
    return rows._replace(points=np.zeros((len(rows.incidents), codes.POINT_COLUMNS)))


def empty_rows(n: Sizes) -> Rows:
    """Return the tables in which compiled code leaves its output rows."""
    ns = n.slots
    columns = {
        "y": n.y,
        "accel": 6 * n.bodies,
        "contact": codes.CONTACT_COLUMNS * n.contacts,
        "energy": 4,
        "joint": 6 * n.connections,
        "applied": 6 * n.forces,
        "value": n.values,
    }
    rows = min(max(ROWS, ROWS_BYTES // (8 * sum(columns.values()))), MOST_ROWS)
    events = min(max(EVENTS, 8 * ns), 2 * ns + INCIDENTS) + n.sensors + n.sliders
    return Rows(
        time=np.zeros(rows),
        **{name: np.zeros((rows, count)) for name, count in columns.items()},
        incident_count=np.zeros(rows, dtype=np.int64),
        incidents=np.zeros(
            (min(rows * ns, 2 * ns + INCIDENTS), codes.INC_MEMORY + n.memory + n.region)
        ),
        points=np.zeros((0, codes.POINT_COLUMNS)),
        events=np.zeros((events, 4)),
        used=np.zeros(3, dtype=np.int64),
    )


def sweep(mechanism: Mechanism) -> Sweep:
    """Return scratch for the recursion and the equations."""
    eq = mechanism.equations
    nt, ne, nh = len(mechanism.tree.body), len(eq.program), int((eq.slot >= 0).sum())
    return Sweep(
        H=np.zeros((nt, 6, 6)),
        S=np.zeros((nt, 6, 6)),
        W=np.zeros((nt, 6, 6)),
        L=np.zeros((nt, 6, 6)),
        c=np.zeros((nt, 6)),
        p=np.zeros((nt, 6)),
        z=np.zeros((nt, 6)),
        a=np.zeros((nt, 6)),
        arm=np.zeros((nt, 3)),
        bias=np.zeros((nt, 6)),
        answer=np.zeros((nt, 6)),
        mark=np.zeros(nt, dtype=np.int64),
        chosen=np.zeros(ne + 1, dtype=np.int64),
        G=np.zeros((len(eq.kind), 12)),
        rate=np.zeros((ne, 4)),
        aim=np.zeros((ne, 2)),
        aimed=np.full(3, np.nan),
        A=np.zeros((ne, ne)),
        multiplier=np.zeros(ne),
        rhs=np.zeros(ne),
        skyline=np.zeros(ne, dtype=np.int64),
        size=np.ones(ne),
        released=np.zeros(ne, dtype=np.int64),
        wanted=np.zeros(ne),
        kept_at=np.zeros(8),
        kept_power=np.zeros(8),
        kept_a=np.zeros((8, nt if ne else 0, 6)),
        quality=np.zeros(codes.QUALITIES),
        stress=np.zeros((ne, 6 * len(mechanism.elements))),
        jet=np.zeros(12),
        pair=np.zeros(3),
        related=np.zeros((int(np.diff(eq.first)[eq.user > 0].max(initial=0)), 3)),
        located=np.zeros(len(mechanism.along)),
        share=np.zeros((nh, nh)),
        mix=np.zeros((nh, nh)),
        cone=np.zeros((codes.CONE_ROWS, nh)),
        kept_p=np.zeros((nt if nh else 0, 6)),
    )

"""What is empty when a run begins: state, log, scratch and the tables of output rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.arrays import scene as a
from mbsim.geometry.catalog import POINT
from mbsim.laws import abi

ROWS = 256
EVENTS = 1024
INCIDENTS = 100_000


def start_state(
    nb: int,
    ng: int,
    ns: int,
    angle: np.ndarray[Any, Any],
    sensors: int = 0,
    switching: int = 0,
    memory: int = 0,
    forces: int = 0,
    residual: tuple[int, int, int] = (0, 2, 0),
    groups: int = 1,
) -> a.State:
    """Return the incident table before anything touched."""
    dry = np.zeros((forces, 4))
    # dry friction begins without force where the first committed state is
    dry[:, [a.SLIDER, a.SLIDER_BEFORE]] = np.nan
    sensed = np.zeros((sensors, 5))
    sensed[:, a.EXCESS] = np.nan
    q = np.zeros((nb + 1, 4))
    q[:, 0] = 1.0
    return a.State(
        q=q,
        w=np.zeros((nb + 1, 3)),
        since=np.zeros(1),
        centre=np.zeros((ng, 3)),
        angle=angle,
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
        sides=np.zeros((switching, 2)),
        frozen=np.zeros(1, dtype=np.int64),
        dry=dry,
        # no time: nothing is remembered yet
        residual=np.full(residual, np.nan),
        fastest=np.zeros(groups),
        chattering=np.zeros(2),
    )


def empty_log(nc: int) -> a.Log:
    """Return empty counters and peaks."""
    contacts = np.zeros((nc, a.LOG_COLUMNS))
    contacts[:, a.FIRST_TOUCH] = np.nan
    contacts[:, a.REBOUND] = np.nan
    contacts[:, a.PEAK_FORCE_TIME] = np.nan
    return a.Log(
        contacts,
        np.zeros(a.COUNTERS, dtype=np.int64),
        np.zeros((nc + 1, 4), dtype=np.int64),
    )


def place_fixed(work: a.Work, graphics: a.Graphics) -> None:
    """Fill what no evaluation fills: rows of ground, of shapes on it, and the axes of spheres."""
    work.R[-1] = np.eye(3)
    work.v[-1] = work.w[-1] = 0.0
    fixed = graphics.body == len(work.R) - 1
    work.frames[fixed] = np.hstack([graphics.p, graphics.R.reshape(-1, 9)])[fixed]
    # nobody turns a sphere
    work.frames[graphics.turns == 0, 3:] = np.eye(3).ravel()
    work.travel[fixed] = 0.0
    work.speed[fixed] = 0.0


def scratch(
    nb: int,
    graphics: a.Graphics,
    np_: int,
    ns: int,
    nc: int,
    nf: int,
    nj: int,
    nu: int,
    memory: int,
    looked: int,
    ahead: int,
    points: int = 0,
    groups: int = 1,
) -> a.Work:
    """Return scratch, with what stands still in its place.

    `ahead`: numbers of y where rates of normal forces are looked for, else 0; `points`: most
    candidates of a pair where friction of contacts is rigid, else 0.
    """
    ng = len(graphics.body)
    work = a.Work(
        R=np.full((nb + 1, 3, 3), np.nan),
        v=np.full((nb + 1, 3), np.nan),
        w=np.full((nb + 1, 3), np.nan),
        force=np.full((nb + 1, 3), np.nan),
        torque=np.full((nb + 1, 3), np.nan),
        noise=np.zeros((nb + 1, 2)),
        frames=np.full((ng, 12), np.nan),
        travel=np.full(ng, np.nan),
        speed=np.full((ng, 2), np.nan),
        points=np.zeros((ns, POINT)),
        touching=np.zeros(ns, dtype=np.int64),
        hit=np.zeros(ns + 1, dtype=np.int64),
        t=np.zeros((ns, 3)),
        slot=np.zeros((ns, a.SLOT_COLUMNS)),
        memory=np.zeros((ns, memory)),
        kept=np.zeros((ns if ahead else 0, 3 + memory)),
        grip=np.zeros((ns, 4)),
        fcl=np.zeros(max(1, np_), dtype=np.int64),
        net=np.zeros((nc, 3)),
        block=np.zeros((nb, 20)),
        bound=np.zeros(2),
        best=np.zeros(4),
        idle=np.zeros(looked),
        ahead=np.zeros((2 if ahead else 0, ahead)),
        law_in=np.zeros(abi.FRICTION_INPUTS + memory),
        law_out=np.zeros(abi.MEMORY_OUT + 2 * memory),
        applied=np.zeros((nf, 8)),
        motion=np.zeros(12),
        wrench=np.zeros(8),
        slopes=np.zeros((12, 6)),
        rub=np.zeros((nf, 9)),
        late=np.zeros((nu, 5)),
        secant=np.zeros((nu, nu)),
        reaction=np.zeros(6 * nj),
        squares=np.full(groups, np.nan),
        trouble=np.full(2, -1, dtype=np.int64),
        hold=np.zeros((ns if points else 0, 15)),
        held=np.zeros((ns if points else 0, 2)),
        look=np.zeros((3, points, POINT)),
    )
    place_fixed(work, graphics)
    return work


def empty_rows(
    n: int,
    nb: int,
    nc: int,
    ns: int,
    nj: int,
    nf: int,
    values: int,
    sensors: int = 0,
    memory: int = 0,
    region: int = 0,
) -> a.Rows:
    """Return the tables in which compiled code leaves its output rows."""
    return a.Rows(
        time=np.zeros(ROWS),
        y=np.zeros((ROWS, n)),
        accel=np.zeros((ROWS, 6 * nb)),
        contact=np.zeros((ROWS, a.CONTACT_COLUMNS * nc)),
        energy=np.zeros((ROWS, 4)),
        joint=np.zeros((ROWS, 6 * nj)),
        applied=np.zeros((ROWS, 6 * nf)),
        value=np.zeros((ROWS, values)),
        incident_count=np.zeros(ROWS, dtype=np.int64),
        incidents=np.zeros((min(ROWS * ns, 2 * ns + INCIDENTS), a.INC_MEMORY + memory + region)),
        events=np.zeros((min(max(EVENTS, 8 * ns), 2 * ns + INCIDENTS) + sensors, 4)),
        used=np.zeros(3, dtype=np.int64),
    )

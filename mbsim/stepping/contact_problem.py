"""The contact problem that a step of MOREAU solved, in FCLIB's terms: `--dump-fclib`.

Where joints hold no body of a contact point it is a global problem in the bodies' velocities,

    M v = H r + M v_free,   u = H' v + w,   w = (ahead, 0, 0) of each point,

else a local one, W = H' answer, q = H' v_free + w: joints are in W then. `ahead` is what the gap
or an impact adds to the normal velocity (`stepping.impacts.look_ahead`), so that
u_N + ahead >= 0 opens. mu is that of the step's slip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.stepping.arrays import (
    ALL_SWEEPS,
    NEWTONS,
    POINTS,
    PRESSING,
    STEP_LENGTH,
    Stepping,
)
from mbsim.stepping.one_point import directions

if TYPE_CHECKING:
    from mbsim.fclib.problem import Global, Local, Solution

Array = np.ndarray[Any, Any]


def contact_problem(S: Stepping, title: str, t: float) -> tuple[Global | Local, Solution] | None:
    """Return the problem solved last, and what its solver found; None where nothing presses.

    That is the problem of a step of the deck's length, else of the second half of the step taken
    last. r are impulses [F T], v velocities of the bodies (6 nb,), linear then angular, global
    axes, u velocities (3 nc,) along (n, x, y) of I relative to J. `t` is the time at its end [T].
    """
    from scipy import sparse

    from mbsim.fclib.problem import Global, Info, Local, Solution, matrix

    P, M, count = S.points, S.motion, int(S.tally.count[POINTS])
    if S.tally.count[PRESSING] == 0:
        return None
    nb = len(M.inverse)
    H = _directions(S, count)
    free, r, w = M.free[:nb].ravel().copy(), P.r[:count].ravel().copy(), np.zeros(3 * count)
    w[0::3] = P.ahead[:count]
    mu = P.mu[:count].copy()
    kind = "local" if (P.wide[:count] >= 0).any() else "global"
    info = Info(
        title=title,
        description=f"time {t!r}, step {float(S.tally.number[STEP_LENGTH])!r}",
        math_info=f"{kind} frictional contact problem of one step of MOREAU",
    )
    inverse = sparse.block_diag(list(M.inverse), format="csc")
    if kind == "local":
        W = (H.T @ _answers(S, count, (inverse @ H).tocsc())).tocsr()
        W = (0.5 * (W + W.T)).tocsr()
        W.eliminate_zeros()
        q = H.T @ free + w
        return Local(3, matrix(W), q, mu, info=info), Solution(W @ r + q, r)
    blocks: list[Array] = []
    for block in M.inverse:
        blocks += [np.diag(1.0 / np.diag(block)[:3]), np.linalg.inv(block[3:, 3:])]
    masses = sparse.block_diag(blocks, format="csr")
    v = free + inverse @ (H @ r)
    problem = Global(3, matrix(masses), matrix(H), masses @ free, w, mu, info=info)
    return problem, Solution(H.T @ v + w, r, v)


def sweeps_so_far(S: Stepping) -> int:
    """Return how many sweeps and Newton iterations the run's contact problems took."""
    return int(S.tally.count[ALL_SWEEPS] + S.tally.count[NEWTONS])


def _directions(S: Stepping, count: int) -> Any:
    """Return H (6 nb, 3 nc); ground has no rows."""
    from scipy import sparse

    nb = len(S.motion.inverse)
    bodies, H = S.points.body[:count], directions(S.points, count, nb)
    k, side, a, c = np.nonzero(H)
    row, moves = 6 * bodies[k, side] + c, bodies[k, side] < nb
    places = row[moves], (3 * k + a)[moves]
    return sparse.coo_array((H[k, side, a, c][moves], places), shape=(6 * nb, 3 * count)).tocsc()


def _answers(S: Stepping, count: int, alone: Any) -> Any:
    """Return the bodies' velocities by impulses (6 nb, 3 nc), `alone` were there no joints."""
    from scipy import sparse

    P, columns = S.points, []
    for k in range(count):
        if P.wide[k] < 0:
            columns.append(alone[:, 3 * k : 3 * k + 3])
            continue
        moved = np.zeros((alone.shape[0], 3))
        for row in range(P.wide[k], P.wide[k] + P.many[k]):
            b = 6 * P.moved[row]
            moved[b : b + 6] += P.moves[row].T
        columns.append(sparse.csc_array(moved))
    return sparse.hstack(columns, format="csc")

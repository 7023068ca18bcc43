"""A few contacts in the plane: every combination of their states, each a linear system.

Where W is singular or friction strong, impulses may run away from a bounded solution whatever the
method. This finds it, unless the system of its states is singular and its shortest solution is not
admissible.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsim.fclib.solvers.task import Task

#: Contacts up to which all 4^n combinations are tried.
FEW = 6
#: Share of the largest terms that a residual or a violated inequality may have.
ADMISSIBLE = 1e-9


def run(task: Task) -> None:
    """Offer the admissible solution whose second figure is smallest."""
    b = task.blocks
    n = b.contacts
    root = np.repeat(np.sqrt(b.rho), 2)
    whole = np.zeros((n, 2, n, 2))
    for a in range(n):
        some = slice(b.ptr[a], b.ptr[a + 1])
        whole[a][:, b.col[some]] = b.val[some].transpose(1, 0, 2)
    # in the contacts' own units
    w = whole.reshape(2 * n, 2 * n) * root[:, None] * root
    size = float(np.abs(b.q * root).max())
    if size == 0.0:
        return
    q = b.q * root / size
    # open, stick, and slip forwards and backwards: r_T = pull * r_N
    for states in product((None, 0.0, -1.0, 1.0), repeat=n):
        if task.late:
            return
        rows, right = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        for a, state in enumerate(states):
            normal, tangent = 2 * a, 2 * a + 1
            if state is None:
                rows[normal, normal] = rows[tangent, tangent] = 1.0
                continue
            rows[normal], right[normal] = w[normal], -q[normal]
            if state == 0.0:
                rows[tangent], right[tangent] = w[tangent], -q[tangent]
            else:
                rows[tangent, tangent] = 1.0
                rows[tangent, normal] = -state * b.mu[a]
        r = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
        room = ADMISSIBLE * (1.0 + float(np.abs(r).max()))
        if float(np.abs(rows @ r - right).max()) > room or float(r[::2].min()) < -room:
            continue
        found = size * r * root
        task.offer(found, *task.look(found))
        if task.error <= task.tol and task.error_q <= task.tol_q:
            return

"""A proof that no impulses at all solve a problem, where a simple one can be found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.fclib.clock import loading

if TYPE_CHECKING:
    from mbsim.fclib.reduction import Blocks

#: Contacts up to which a proof is looked for, with full matrices.
MANY = 300
#: Rounding of a sum, relatively to its terms.
ROUNDING = 1e-13


def proof_work(contacts: int) -> float:
    """Return the estimated seconds that looking for a proof takes."""
    return 1e-4 + 3e-9 * contacts**3 if contacts <= MANY else 0.0


def is_infeasible(blocks: Blocks) -> bool:
    """Return whether weights y >= 0 of the contacts prove that no impulses keep all from closing.

    Every solution has u_N >= 0, so y' u_N >= 0. With c = W_N' y, W_N the normal rows of W,
    y' u_N = y' q_N + c' r, and c' r <= 0 for all r in the cones if c_N + mu |c_T| + mu_r |c_R| <= 0
    at every contact. With y' q_N < 0 that is a contradiction (Farkas). Weights with c = 0 are
    looked for by nonnegative least squares; where there are none nothing is proved.
    """
    nc, nt = blocks.contacts, len(blocks.tangent)
    if not 0 < nc <= MANY:
        return False
    with loading():
        from scipy.optimize import nnls

    d = 1 + nt + len(blocks.rolling)
    normal = np.zeros((nc, nc, d))
    for a in range(nc):
        some = slice(blocks.ptr[a], blocks.ptr[a + 1])
        normal[a, blocks.col[some]] = blocks.val[some, 0]
    # in the contacts' own units, so that neither these nor masses matter
    root = np.sqrt(blocks.rho)
    rows = (normal * root[:, None, None] * root[None, :, None]).reshape(nc, -1)
    gaps = blocks.q[::d] * root
    largest = float(np.abs(gaps).max())
    if largest == 0.0:
        return False
    gaps /= largest
    wanted = np.zeros(rows.shape[1] + 1)
    wanted[-1] = -1.0
    try:
        weights = nnls(np.vstack((rows.T, gaps)), wanted)[0]
    except RuntimeError:
        return False  # its iterations ended
    terms = (weights @ np.abs(rows)).reshape(nc, d)
    return bool(_pulls(blocks, (weights @ rows).reshape(nc, d), nt) <= ROUNDING * terms.max()) and (
        float(weights @ gaps) < -1e-6 * float(weights @ np.abs(gaps))
    )


def _pulls(blocks: Blocks, c: Any, nt: int) -> float:
    """Return the largest c' r over r in the cones with r_N = 1 at one contact."""
    slide = np.linalg.norm(c[:, 1 : 1 + nt], axis=1)
    roll = np.linalg.norm(c[:, 1 + nt :], axis=1)
    return float((c[:, 0] + blocks.mu * slide + blocks.mu_r * roll).max())

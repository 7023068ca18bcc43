"""Which rows a view keeps: those between which motion is straight, to a tolerance."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array
from mbsim.view.motion import Poses, between

#: Rows that one kept row may stand before at most.
_LONGEST = 512


def kept_rows(time: Array, poses: Poses, reach: Array, tolerance: float) -> npt.NDArray[np.int64]:
    """Return the rows to keep, in order, the first and the last among them.

    Between two kept rows positions and quaternions change linearly with time. No point of a body,
    at most `reach` (bodies,) [L] from its centre, is then off by more than `tolerance` [L] at any
    row. Each kept row is the farthest from the one before for which this holds.
    """
    n = len(time)
    rows = [0] if n else []
    while n and rows[-1] < n - 1:
        first = rows[-1]
        good, step = first + 1, 2
        bad = min(n, first + _LONGEST + 1)
        while good < bad - 1:
            trial = min(first + step, bad - 1)
            if error(time, poses, reach, first, trial) <= tolerance:
                good, step = trial, 2 * step
            else:
                bad = trial
                break
        while good + 1 < bad:
            middle = (good + bad) // 2
            if error(time, poses, reach, first, middle) <= tolerance:
                good = middle
            else:
                bad = middle
        rows.append(good)
    return np.array(rows, dtype=np.int64)


def error(time: Array, poses: Poses, reach: Array, first: int, last: int) -> float:
    """Return the largest distance by which any point is off between two rows that are kept [L]."""
    if last - first < 2 or not poses.p.shape[1]:
        return 0.0
    inside = slice(first + 1, last)
    span = time[last] - time[first]
    share = (time[inside] - time[first]) / span if span > 0.0 else np.zeros(last - first - 1)
    p, q = between(poses, first, last, share)
    off = np.linalg.norm(p - poses.p[inside], axis=2)
    # the angle between near unit quaternions is twice the length of their difference
    off += 2.0 * reach * np.linalg.norm(q - poses.q[inside], axis=2)
    return float(off.max())

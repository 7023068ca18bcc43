"""Block Gauss-Seidel (NSGS): contact by contact, each solved exactly."""

from __future__ import annotations

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import product
from mbsim.fclib.cone import relative_errors
from mbsim.fclib.one_contact import contact_2d, contact_3d, contact_rolling


@jitable
def sweep(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, work):
    """Solve every contact once, with the newest impulses of the others; return |change|^2."""
    d = 1 + len(tangent) + len(rolling)
    change = 0.0
    for a in range(len(mu)):
        first = d * a
        own = diagonal[a]
        for row in range(d):
            work[row] = q[first + row]
        for k in range(ptr[a], ptr[a + 1]):
            if k != own:
                b = d * col[k]
                for row in range(d):
                    total = 0.0
                    for c in range(d):
                        total += val[k, row, c] * r[b + c]
                    work[row] += total
        for row in range(d):
            work[d + row] = r[first + row]
        if len(rolling) > 0:
            contact_rolling(
                tangent, rolling, val, own, work, mu[a], mu_r[a], r, first,
                work[2 * d : 3 * d], work[3 * d : 5 * d],
            )  # fmt: skip
        elif len(tangent) == 1:
            r[first], r[first + 1] = contact_2d(
                val, own, work[0], work[1], mu[a], r[first], r[first + 1]
            )
        else:
            r[first], r[first + 1], r[first + 2] = contact_3d(
                val, own, work[0], work[1], work[2], mu[a],
                r[first], r[first + 1], r[first + 2],
            )  # fmt: skip
        for row in range(d):
            change += (r[first + row] - work[d + row]) ** 2
    return change


@jitable
def diagonal_places(ptr, col):
    """Return where each row's diagonal block is."""
    places = np.empty(len(ptr) - 1, np.int32)
    for a in range(len(ptr) - 1):
        for k in range(ptr[a], ptr[a + 1]):
            if col[k] == a:
                places[a] = k
    return places


@jitable
def gauss_seidel(
    tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, tol, tol_q, sweeps, every, history
):
    """Sweep until the error is at most `tol` and |F|/|q| at most `tol_q`.

    The error is looked at after every `every` sweeps, and when a sweep changes less than `tol`
    of the impulses. `history` gets rows (sweeps done, error, |F|/|q|) as long as it has room.
    Returns sweeps done, error, |F|/|q| and the number of rows.
    """
    d = 1 + len(tangent) + len(rolling)
    work = np.empty(5 * d)
    u = np.empty(len(q))
    missing = np.empty(len(q))
    rows = 0
    error, error_q = np.inf, np.inf
    done = 0
    looked = -1
    while done < sweeps:
        change = sweep(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, work)
        done += 1
        small = False
        if done - looked > 1 and done % every:
            size = 0.0
            for k in range(len(r)):
                size += r[k] * r[k]
            small = change <= tol * tol * size
        if done % every == 0 or small or done == sweeps:
            looked = done
            product(tangent, rolling, ptr, col, val, q, r, u)
            error, error_q = relative_errors(tangent, rolling, mu, mu_r, q, u, r, missing)
            if rows < len(history):
                history[rows, 0] = done
                history[rows, 1] = error
                history[rows, 2] = error_q
                rows += 1
            if error <= tol and error_q <= tol_q:
                break
    return done, error, error_q, rows

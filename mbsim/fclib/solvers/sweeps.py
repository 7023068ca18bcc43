"""Block Gauss-Seidel (NSGS): contact by contact, each solved exactly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import (
    add_row,
    block_rows,
    compressed_rows,
    diagonal_places,
    own_units,
    product,
    product_of_stored,
)
from mbsim.fclib.clock import compiled, late
from mbsim.fclib.cone import (
    DECIDING,
    EVERY_SHARE,
    FREE,
    PUBLISHED,
    improves,
    natural_map,
    norm,
    own_errors,
    own_share,
    relative_errors,
    residual,
    rounding,
)
from mbsim.fclib.one_contact import contact_2d, contact_3d, contact_rolling
from mbsim.fclib.solvers.task import POLISHED, ROWS, Task

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector
    from mbsim.fclib.reduction import Blocks


#: Sweeps that |F|/|q| gets at least once the error is small.
GRACE = 20
#: POLISHED with few contacts, where a sweep costs next to nothing.
POLISHED_FEW = 1e-3
#: With few contacts, sweeps between leaps ahead.
LEAP = 8
#: Rounds in which weak contacts are mended where they are no more than one in so many.
MENDING, WEAK = 5, 20
#: Contacts whose sweep takes long enough to ask the clock after each.
LONG = 200


@jitable
def sweep(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, some, work):
    """Solve contacts `some` once, with the newest impulses of the others; return |change|^2."""
    d = 1 + len(tangent) + len(rolling)
    change = 0.0
    for a in some:
        first = d * a
        own = diagonal[a]
        for row in range(d):
            work[row] = q[first + row]
        add_row(tangent, rolling, col, val, r, ptr[a], own, work, 0)
        add_row(tangent, rolling, col, val, r, own + 1, ptr[a + 1], work, 0)
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
def local_sweeps(
    tangent, m, nz, p, i, x, q, mu, r, tol, tol_q, sweeps, every, grace, until, history, check
):
    """Bring a local problem as it is stored into blocks and sweep (`gauss_seidel`).

    `check` gets the figures of the verdict, with the stored W: |F| / max(|q|, |r|, |u|), |F| / |q|,
    and those of `own_errors`. Returns the blocks, u, and what `gauss_seidel` does.
    """
    d = 1 + len(tangent)
    ptr, col, val = block_rows(d, len(mu), *compressed_rows(m, m, nz, p, i, x))
    diagonal = diagonal_places(ptr, col)
    rho = own_units(val, diagonal)
    # without rolling directions the numbers of mu_r do not matter
    done, error, error_q, rows = gauss_seidel(
        tangent, (), ptr, col, val, diagonal, q, mu, mu, rho, r, tol, tol_q, sweeps, every, grace,
        until, history,
    )  # fmt: skip
    u = q.copy()
    product_of_stored(m, nz, p, i, x, r, u)
    work = np.empty(m)
    missing, bound = residual(tangent, (), mu, mu, u, r, work), norm(q)
    scale = max(bound, norm(r), norm(u))
    check[0] = missing / scale if scale > 0.0 else missing
    check[1] = missing / bound if bound > 0.0 else missing
    check[2], check[3], check[4], check[5] = own_errors(
        tangent, (), ptr, col, val, mu, mu, rho, q, u, r, EVERY_SHARE, work
    )
    return ptr, col, val, diagonal, rho, u, done, error, error_q, rows


@jitable
def _leap(r, old, older, trial):
    """Write where three iterates lead if one slow direction is left; return whether they do.

    The change shrinks by a factor c each sweep, so that c / (1 - c) of the last one is to come
    (Aitken's extrapolation of vectors).
    """
    product_, square = 0.0, 0.0
    for k in range(len(r)):
        change = old[k] - older[k]
        product_ += (r[k] - old[k]) * change
        square += change * change
    if not square > 0.0:
        return False
    shrink = product_ / square
    if shrink < 0.3 or shrink > 0.99999:
        return False
    for k in range(len(r)):
        trial[k] = r[k] + shrink / (1.0 - shrink) * (r[k] - old[k])
    return True


@jitable
def gauss_seidel(
    tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, rho, r, tol, tol_q, sweeps, every,
    grace, until, history,
):  # fmt: skip
    """Sweep until the error is at most `tol` and |F|/|q| at most `tol_q`.

    With the first reached, the second gets as many sweeps again, and `grace` more, at most; with
    both reached, as many sweeps again may bring a tenth of them (POLISHED), with few contacts a
    thousandth. The last sweep is the one after which it is late (`clock.until`).
    The error is looked at after every `every` sweeps, and when a sweep changes less than `tol`
    of the impulses. `history` gets rows (sweeps done, error, |F|/|q|) as long as it has room.
    Returns sweeps done, error, |F|/|q| and the number of rows.
    """
    d = 1 + len(tangent) + len(rolling)
    work = np.empty(5 * d)
    every_one = np.arange(len(mu))
    u = np.empty(len(q))
    missing = np.empty(len(q))
    few = len(q) if every == 1 else 0
    old, older, trial = np.empty(few), np.empty(few), np.empty(few)
    rows = 0
    error, error_q = np.inf, np.inf
    done = 0
    looked = -1
    most = sweeps
    between = 1 + LONG // max(len(mu), 1)
    kept = np.empty(0)
    kept_error, kept_q = np.inf, np.inf
    # with few contacts every sweep is looked at, and rows say little of the sweeps to come
    shares = PUBLISHED if every == 1 else DECIDING
    over = False
    while done < most and not over:
        change = sweep(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, every_one, work)
        done += 1
        over = done % between == 0 and late(until)
        small = False
        if done - looked > 1 and done % every:
            size = 0.0
            for k in range(len(r)):
                size += r[k] * r[k]
            small = change <= tol * tol * size
        if done % every == 0 or small or done == most or over:
            looked = done
            product(tangent, rolling, ptr, col, val, q, r, u)
            error, error_q = relative_errors(
                tangent, rolling, ptr, col, val, mu, mu_r, rho, q, u, r, shares, missing
            )
            if shares == PUBLISHED and error <= tol:
                error, error_q = relative_errors(
                    tangent, rolling, ptr, col, val, mu, mu_r, rho, q, u, r, DECIDING, missing
                )
            if rows < len(history):
                history[rows, 0] = done
                history[rows, 1] = error
                history[rows, 2] = error_q
                rows += 1
            if error <= tol:
                if error_q <= (POLISHED_FEW if every == 1 else POLISHED) * tol_q:
                    break
                if error_q <= tol_q and len(kept) == 0:
                    most = 2 * done
                    kept = r.copy()
                    kept_error, kept_q = error, error_q
                elif most == sweeps:
                    most = min(sweeps, 2 * done + grace)
            elif every == 1 and done > LEAP:
                # few contacts: one slow direction is often all that is left
                phase = done % LEAP
                if phase == LEAP - 2:
                    older[:] = r
                elif phase == LEAP - 1:
                    old[:] = r
                elif phase == 0 and _leap(r, old, older, trial):
                    sweep(
                        tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, trial, every_one,
                        work,
                    )  # fmt: skip
                    product(tangent, rolling, ptr, col, val, q, trial, u)
                    leapt, leapt_q = relative_errors(
                        tangent, rolling, ptr, col, val, mu, mu_r, rho, q, u, trial, shares, missing
                    )
                    if leapt <= tol:
                        leapt, leapt_q = relative_errors(
                            tangent, rolling, ptr, col, val, mu, mu_r, rho, q, u, trial, DECIDING,
                            missing,
                        )  # fmt: skip
                    done += 1
                    if leapt < error:
                        r[:] = trial
                        error, error_q = leapt, leapt_q
                        if error <= tol and error_q <= tol_q:
                            break
    if shares == PUBLISHED and error > tol:
        product(tangent, rolling, ptr, col, val, q, r, u)
        error, error_q = relative_errors(
            tangent, rolling, ptr, col, val, mu, mu_r, rho, q, u, r, DECIDING, missing
        )
    if len(kept) > 0 and not (error <= tol and improves(error_q, norm(r), kept_q, norm(kept))):
        r[:] = kept
        error, error_q = kept_error, kept_q
    return done, error, error_q, rows


@jitable
def mend_weak(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, rho, r, tol, most):
    """Sweep over weak contacts, whose share (`own_share`) is above a third of the `tol` for it.

    That is done as long as they are not more than `most` and one of them is above; returns whether
    in the end none is.
    """
    d = 1 + len(tangent) + len(rolling)
    u, missing, work = np.empty(len(q)), np.empty(len(q)), np.empty(5 * d)
    some = np.empty(most, np.int64)
    velocity, reach = rounding(d, rho, q, r)
    for _ in range(MENDING):
        product(tangent, rolling, ptr, col, val, q, r, u)
        found, above = 0, 0
        for a in range(len(mu)):
            square = natural_map(tangent, rolling, mu[a], mu_r[a], u, r, d * a, rho[a], missing)
            share = own_share(d, ptr, col, val, rho, q, u, r, a, square, velocity, reach)[1]
            above += 1 if share > tol else 0
            if 3.0 * share > tol:
                if found == most:
                    return False
                some[found] = a
                found += 1
        if above == 0:
            return True
        for _ in range(3):
            sweep(tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, r, some[:found], work)
    return False


def mended(task: Task) -> Vector | None:
    """Return the best iterate with its weak contacts mended, if these are few and that works."""
    b = task.blocks
    r = task.r.copy()
    done = compiled(mend_weak)(
        b.tangent, b.rolling, b.ptr, b.col, b.val, b.diagonal, b.q, b.mu, b.mu_r, b.rho, r,
        FREE * task.tol_q, 1 + b.contacts // WEAK,
    )  # fmt: skip
    return r if done else None


def mend(task: Task) -> None:
    """Within the first goal, try whether a few weak contacts are all that is left over."""
    if task.over or task.error > task.tol or task.r is task.mended:
        return
    task.mended = task.r
    r = mended(task)
    if r is None:
        return
    error, error_q = task.look(r)
    if task.offer(r, error, error_q):
        task.iterations += 1
        task.work += 3.0 * sweep_work(task.blocks)
        task.note("NSGS", np.array([[task.iterations, error, error_q]]))


def nsgs(task: Task, sweeps: int, every: int = 5, start: Vector | None = None) -> Vector:
    """Sweep at most `sweeps` times from `start`, by default the best iterate; return the last."""
    b = task.blocks
    r: Vector = (task.r if start is None else start).copy()
    history = np.empty((min(ROWS, sweeps // every + 2), 3))
    done, error, error_q, rows = compiled(gauss_seidel)(
        b.tangent, b.rolling, b.ptr, b.col, b.val, b.diagonal, b.q, b.mu, b.mu_r, b.rho, r,
        task.tol, task.tol_q, sweeps, every, GRACE, task.until, history,
    )  # fmt: skip
    history[:rows, 0] += task.iterations
    task.iterations += done
    task.work += done * sweep_work(b)
    task.offer(r, error, error_q)
    task.note("NSGS", history[:rows])
    return r


def sweep_work(b: Blocks) -> float:
    """Return the estimated seconds of a sweep."""
    if b.rolling:
        return 1e-5 * b.contacts + 2e-8 * len(b.col)
    if len(b.tangent) == 1:
        return 1e-8 * b.contacts + 1.5e-9 * len(b.col)
    return 3e-8 * b.contacts + 6e-9 * len(b.col)


def run(task: Task) -> None:
    """Sweep until the goal is reached or the time is over (NSGS)."""
    every = 1 if task.blocks.contacts <= 10 else 5
    chunk = 1000
    while not task.done and not task.late:
        before = task.error
        nsgs(task, chunk, every)
        if task.error >= before * (1.0 - 1e-12) and task.iterations >= 20 * chunk:
            return  # at rounding, or it does not converge

"""Block Gauss-Seidel (NSGS): contact by contact, each solved exactly."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import (
    DelassusSystem,
    add_row,
    block_rows,
    compressed_rows,
    diagonal_and_units,
    product,
    product_of_stored,
)
from mbsim.fclib.bodies.sweeps import sweep_system
from mbsim.fclib.clock import compiled, late
from mbsim.fclib.cone import (
    DECIDING,
    EVERY_SHARE,
    FREE,
    PUBLISHED,
    errors_at,
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
from mbsim.fclib.solvers.task import POLISHED, ROWS, Goal, Task, record

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector
    from mbsim.fclib.reduction import Blocks


#: Sweeps that |F|/|q| gets at least once the error is small.
GRACE = 20
#: POLISHED with few contacts, where a sweep costs next to nothing.
POLISHED_FEW = 1e-3
#: With few contacts, sweeps between extrapolations.
CYCLE = 8
#: Rounds in which weak contacts are mended where they are no more than one in so many.
MENDING, WEAK = 5, 20
#: Contacts whose sweep takes long enough to ask the clock after each.
LONG = 200


@jitable
def sweep(system: DelassusSystem, r: Vector, some: Indices, work: Vector) -> float:
    """Solve contacts `some` once, with the newest impulses of the others; return |change|^2."""
    tangent, rolling, diagonal = system.tangent, system.rolling, system.diagonal
    ptr, col, val, q = system.ptr, system.col, system.val, system.q
    mu, mu_r = system.mu, system.mu_r
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
                tangent, rolling, val, own, work, mu[a], mu_r[a], r, first, work[2 * d :]
            )
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
    tangent: tuple[int, ...],
    stored: tuple[Any, ...],
    q: Vector,
    mu: Vector,
    r: Vector,
    goal: tuple[Any, ...],
    sweeps: int,
    every: int,
    history: Vector,
    check: Vector,
    u: Vector,
) -> tuple[Any, ...]:
    """Bring a local problem as it is stored into blocks and sweep (`gauss_seidel`).

    `stored` is W: (rows, nz, p, i, x); `goal` what `Goal` has. This one call is often all that a
    small problem takes: so both are plain tuples, since named ones cost 1 us to hand over, and the
    blocks are returned only where the goal was not reached, since an array costs 0.4 us. `check`
    gets the figures of the verdict, with the stored W: |F| / max(|q|, |r|, |u|), |F| / |q|, and
    those of `own_errors`; `u` the velocities. Many arguments because a record of them would cost
    more to hand over. Returns what `gauss_seidel` does, and the blocks.
    """
    d = 1 + len(tangent)
    m, nz, p, i, x = stored
    ptr, col, val = block_rows(d, len(mu), *compressed_rows(m, m, nz, p, i, x))
    diagonal, rho = diagonal_and_units(ptr, col, val)
    # without rolling directions the numbers of mu_r do not matter
    system = DelassusSystem(tangent, (), ptr, col, val, diagonal, q, mu, mu, rho)
    done, error, error_q, rows = gauss_seidel(system, r, Goal(*goal), sweeps, every, history)
    u[:] = q
    product_of_stored(m, nz, p, i, x, r, u)
    work = np.empty(m)
    missing, bound = residual(tangent, (), mu, mu, u, r, work), norm(q)
    scale = max(bound, norm(r), norm(u))
    check[0] = missing / scale if scale > 0.0 else missing
    check[1] = missing / bound if bound > 0.0 else missing
    check[2], check[3], check[4], check[5] = own_errors(system, u, r, EVERY_SHARE, work)
    reached = error <= goal[0] and error_q <= goal[1]
    return done, error, error_q, rows, None if reached else (ptr, col, val, diagonal, rho)


@jitable
def _extrapolate(r: Vector, old: Vector, older: Vector, trial: Vector) -> bool:
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
def _errors(
    system: DelassusSystem, r: Vector, u: Vector, shares: int, tol: float, work: Vector
) -> tuple[float, float]:
    """Return the errors of an iterate (`relative_errors`); PUBLISHED says all only above `tol`."""
    error, error_q = errors_at(system, r, u, shares, work)
    if shares == PUBLISHED and error <= tol:
        error, error_q = relative_errors(system, u, r, DECIDING, work)
    return error, error_q


@jitable
def gauss_seidel(  # noqa: C901
    system: DelassusSystem, r: Vector, goal: Goal, sweeps: int, every: int, history: Vector
) -> tuple[int, float, float, int]:
    """Sweep until the error is at most `tol` and |F|/|q| at most `tol_q` (`Goal`).

    With the first reached, the second gets as many sweeps again, and GRACE more, at most; with
    both reached, as many sweeps again may bring a tenth of them (POLISHED), with few contacts a
    thousandth. The last sweep is the one after which it is late (`clock.until`).
    The error is looked at after every `every` sweeps, and when a sweep changes less than `tol`
    of the impulses. `history` gets rows (sweeps done, error, |F|/|q|) as long as it has room.
    Returns sweeps done, error, |F|/|q| and the number of rows.
    Many branches because each of these reasons to go on or to stop is weighed after every look.
    """
    tol, tol_q = goal.tol, goal.tol_q
    nc, m = len(system.mu), len(system.q)
    work = np.empty(5 * (1 + len(system.tangent) + len(system.rolling)))
    every_one = np.arange(nc)
    u, missing = np.empty(m), np.empty(m)
    few = m if every == 1 else 0
    old, older, trial = np.empty(few), np.empty(few), np.empty(few)
    rows, done, looked, most = 0, 0, -1, sweeps
    error, error_q = np.inf, np.inf
    between = 1 + LONG // max(nc, 1)
    kept = np.empty(0)
    kept_error, kept_q = np.inf, np.inf
    # with few contacts every sweep is looked at, and rows say little of the sweeps to come
    shares = PUBLISHED if every == 1 else DECIDING
    over = False
    while done < most and not over:
        change = sweep(system, r, every_one, work)
        done += 1
        over = done % between == 0 and late(goal.until)
        small = False
        if done - looked > 1 and done % every:
            size = 0.0
            for k in range(m):
                size += r[k] * r[k]
            small = change <= tol * tol * size
        if not (done % every == 0 or small or done == most or over):
            continue
        looked = done
        error, error_q = _errors(system, r, u, shares, tol, missing)
        rows = record(history, rows, done, error, error_q)
        if error <= tol:
            if error_q <= (POLISHED_FEW if every == 1 else POLISHED) * tol_q:
                break
            if error_q <= tol_q and len(kept) == 0:
                most = 2 * done
                kept = r.copy()
                kept_error, kept_q = error, error_q
            elif most == sweeps:
                most = min(sweeps, 2 * done + GRACE)
        elif every == 1 and done > CYCLE:
            # few contacts: one slow direction is often all that is left
            phase = done % CYCLE
            if phase == CYCLE - 2:
                older[:] = r
            elif phase == CYCLE - 1:
                old[:] = r
            elif phase == 0 and _extrapolate(r, old, older, trial):
                sweep(system, trial, every_one, work)
                done += 1
                ahead, ahead_q = _errors(system, trial, u, shares, tol, missing)
                if ahead < error:
                    r[:] = trial
                    error, error_q = ahead, ahead_q
                    if error <= tol and error_q <= tol_q:
                        break
    if shares == PUBLISHED and error > tol:
        error, error_q = _errors(system, r, u, DECIDING, tol, missing)
    if len(kept) > 0 and not (error <= tol and improves(error_q, norm(r), kept_q, norm(kept))):
        r[:] = kept
        error, error_q = kept_error, kept_q
    return done, error, error_q, rows


@jitable
def sweep_onward(
    system: DelassusSystem, r: Vector, some: Indices, part: float, work: Vector
) -> None:
    """Solve contacts `some`, and again and again those beside one that changed by more than a part.

    So what presses lightly comes to the end of a chain, each contact by the one before it. That
    takes no more than one sweep over all contacts.
    """
    ptr, col, n = system.ptr, system.col, len(system.mu)
    d = len(system.q) // n
    queue, waits = np.empty(n, np.int64), np.zeros(n, np.int64)
    count, first = len(some), 0
    for k in range(count):
        queue[k], waits[some[k]] = some[k], 1
    for _ in range(n):
        if count == 0:
            return
        a, here = queue[first], first
        waits[a] = 0
        change, size = sweep(system, r, queue[here : here + 1], work), 0.0
        first, count = (first + 1) % n, count - 1
        for k in range(d * a, d * a + d):
            size += r[k] ** 2
        if math.sqrt(change) <= part * math.sqrt(size):
            continue
        for j in range(ptr[a], ptr[a + 1]):
            if col[j] != a and waits[col[j]] == 0:
                queue[(first + count) % n], waits[col[j]] = col[j], 1
                count += 1


@jitable
def mend_weak(system: DelassusSystem, r: Vector, tol: float, most: int) -> bool:
    """Sweep over weak contacts, whose share (`own_share`) is above a third of the `tol` for it.

    That is done as long as they are not more than `most` and one of them is above; returns whether
    in the end none is.
    """
    tangent, rolling, mu, mu_r = system.tangent, system.rolling, system.mu, system.mu_r
    d, m = 1 + len(tangent) + len(rolling), len(system.q)
    u, missing, work = np.empty(m), np.empty(m), np.empty(5 * d)
    some = np.empty(most, np.int64)
    velocity, reach = rounding(system, r)
    for _ in range(MENDING):
        product(system, system.q, r, u)
        found, above = 0, 0
        for a in range(len(mu)):
            square = natural_map(
                tangent, rolling, mu[a], mu_r[a], u, r, d * a, system.rho[a], missing
            )
            share = own_share(system, u, r, a, square, velocity, reach)[1]
            above += 1 if share > tol else 0
            if 3.0 * share > tol:
                if found == most:
                    return False
                some[found] = a
                found += 1
        if above == 0:
            return True
        sweep_onward(system, r, some[:found], 0.1 * tol, work)
    return False


def mended(task: Task) -> Vector | None:
    """Return the best iterate with its weak contacts mended, if these are few and that works."""
    b = task.blocks
    r = task.r.copy()
    done = compiled(mend_weak)(b.system, r, FREE * task.tol_q, 1 + b.contacts // WEAK)
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
    if b.rigid is None:
        done, error, error_q, rows = compiled(gauss_seidel)(
            b.system, r, task.goal, sweeps, every, history
        )
    else:
        system, bodies = b.rigid
        done, error, error_q, rows = compiled(sweep_system)(
            system, len(bodies.number), r, task.goal, sweeps, every, history
        )
    history[:rows, 0] += task.iterations
    task.iterations += done
    task.work += done * sweep_work(b)
    task.offer(r, error, error_q)
    task.note("NSGS", history[:rows])
    return r


def sweep_work(b: Blocks) -> float:
    """Return the estimated seconds of a sweep."""
    if b.rigid is not None:
        return (1e-5 if b.rolling else 9e-8) * b.contacts
    if b.rolling:
        return 1e-5 * b.contacts + 2e-8 * len(b.col)
    if len(b.tangent) == 1:
        return 1e-8 * b.contacts + 1.5e-9 * len(b.col)
    return 3e-8 * b.contacts + 6e-9 * len(b.col)


def run(task: Task) -> None:
    """Sweep until the goal is reached or the time is over (NSGS)."""
    every = 1 if task.blocks.contacts <= 10 else 5
    chunk = 1000
    last = task.r
    while not task.done and not task.late:
        before = task.error
        # from the last iterate: from a better one that stays the best the same sweeps would follow
        last = nsgs(task, chunk, every, start=last)
        if task.error >= before * (1.0 - 1e-12) and task.iterations >= 20 * chunk:
            return  # at rounding, or it does not converge

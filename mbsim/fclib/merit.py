"""How good a pair u, r is: the one definition of the error, MERIT_1, and figures without scales.

The natural map of a contact is F = r - P_K(r - (u + mu |u_T| e_N)), P_K the projection on
K = {|r_T| <= mu r_N}; it is zero exactly at a solution.

* `error` (Siconos 4.4). Local: |F| / max(|q|, |r|, |u|), u = W r + V l + q. Global: |F| / max(|u|,
  |r|) + |M v - H r - G l - f| / max(|f|, |M v|, |H r|, |G l|), u = H' v + w. A scale of 0 does
  not divide. With equality constraints, their residual over its largest term is added (Siconos
  takes none). With r much larger than q a small error says little of penetration: look at
  `error_q` too.
* `error_q`: |F| / |q|, the same with the scale of the data alone (of the condensed q in a global
  problem).
* `own_error`: |F| / max(|rho q|, |r|, |rho u|), the first with rho_i = 1 / lambda_max(W_ii) for
  each contact in place of 1; W, q are condensed. Units do not matter to it.
* `scale_free`: max_i |F_i| / max(|r_i|, rho_i |q_i|) with these rho_i: no contact, light ones among
  heavy ones included, may be wrong by more. Contacts of which all three are below the rounding of
  their velocity are left out (`cone.own_share`).
* `velocity_error`: |F / rho| / |q|. As impulses grow without bound all others but `error_q` fall,
  and that depends on units.
* `merit1`: FCLIB's MERIT_1 as its code has it,
  |F| / (1 + sqrt(|q|)) + |V' r + R l + s| / (1 + |s|).
  The *square root of the norm* is a slip (|q| is a norm already) that every published figure has.
  libfclib's own function has three more faults, which are not reproduced: W, V and R in compressed
  rows or triplets are silently left out (`cs_gaxpy` takes columns only and its return value is not
  looked at), so that it judges u = q; with V and R its newer versions crash (`cs_transpose(V, 0)`);
  in the plane and for global problems it returns 0.
* `merit1_corrected`: the same with |q| in place of its square root.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.fclib.clock import compiled
from mbsim.fclib.cone import EVERY_SHARE, FREE, own_errors, residual
from mbsim.fclib.problem import Global, Local, Solution, length
from mbsim.fclib.reduction import (
    directions,
    multipliers,
    reduce,
    times,
    transposed_times,
    velocities,
)

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector
    from mbsim.fclib.reduction import Blocks

#: A contact at the edge of its cone that is slower than this share of |q| or |u| sticks.
AT_REST = 1e-7
#: Times the tolerance from which a velocity error is no small one.
FAR = 100.0
#: States of a contact.
OPEN, STICK, SLIP = 0, 1, 2
STATES = ("open", "stick", "slip")


@dataclass(frozen=True, eq=False)
class Figures:
    """What can be said of a pair u, r.

    Parameters
    ----------
    error, error_q, own_error, scale_free, velocity_error, merit1, merit1_corrected
        As the module says.
    dynamics, equalities
        Relative residuals of M v = H r + G l + f and of the equality constraints (0 without).
    max_cone_violation
        Largest distance of an impulse outside K, over the largest impulse.
    max_penetration_velocity
        Largest -u_N, in the problem's units.
    relative_penetration
        The same over the largest |q| of a contact.
    complementarity
        Largest |(u + mu |u_T| e_N) . r| of a contact, over the largest |u| and the largest |r|.
    max_impulse, impulse_norm
        Largest |r| of a contact, and |r|.
    states
        (nc,) 0 open, 1 stick, 2 slip: which of the law's conditions holds best.
    """

    error: float
    error_q: float
    own_error: float
    scale_free: float
    velocity_error: float
    merit1: float
    merit1_corrected: float
    dynamics: float
    equalities: float
    max_cone_violation: float
    max_penetration_velocity: float
    relative_penetration: float
    complementarity: float
    max_impulse: float
    impulse_norm: float
    states: Any

    def counts(self) -> dict[str, int]:
        """Return how many contacts are in each state."""
        found = np.bincount(self.states, minlength=len(STATES))
        return {name: int(count) for name, count in zip(STATES, found, strict=True)}


def completed(problem: Local | Global, r: Vector, blocks: Blocks | None = None) -> Solution:
    """Return u, v and l that go with impulses r."""
    if isinstance(problem, Local) and problem.V is None:
        return Solution(times(problem.W, r) + problem.q, r)
    blocks = reduce(problem) if blocks is None else blocks
    l = multipliers(blocks, r)  # noqa: E741  FCLIB's name
    if isinstance(problem, Local):
        u = times(problem.W, r) + problem.q
        return Solution(u if l is None or problem.V is None else u + times(problem.V, l), r, l=l)
    v = velocities(problem, blocks, r, l)
    return Solution(transposed_times(problem.H, v) + problem.w, r, v, l)


def judge(problem: Local | Global, solution: Solution, blocks: Blocks | None = None) -> Figures:
    """Return all figures of a solution; u is recomputed, as in FCLIB, not believed.

    Multipliers and velocities that the solution does not have are computed from r.
    """
    blocks = reduce(problem) if blocks is None else blocks
    q = blocks.q if isinstance(problem, Global) else problem.q
    found = _whole(problem, solution, blocks)
    error, missing, u, dynamics, equalities, absolute = _error(problem, found)
    bound = length(q)
    return Figures(
        error,
        _over(missing, bound),
        *_own(blocks, u, found.r)[:3],
        missing / (1.0 + math.sqrt(bound)) + absolute,
        missing / (1.0 + bound) + absolute,
        dynamics,
        equalities,
        *_figures(problem, u, found.r, q),
    )


class Errors(NamedTuple):
    """What decides whether a problem is solved (`Figures`)."""

    error: float
    error_q: float
    own_error: float
    scale_free: float
    velocity_error: float
    #: What of `scale_free` is not rounding of velocities.
    attainable: float = 0.0

    def status(self, tol: float) -> str:
        """Return `solved`, `solved_relative` or `not_solved`.

        `solved_relative`: only the published error is met, in the units given and in the contacts'
        own; some contact may be far off. It is not met where it is small only against impulses that
        run away, and velocities are FAR off.
        """
        speed = self.velocity_error
        if not (self.error <= tol and self.own_error <= tol and speed <= FAR * tol):
            return "not_solved"
        met = self.scale_free <= FREE * tol and speed <= FREE * tol
        return "solved" if met else "solved_relative"


def errors(problem: Local | Global, solution: Solution, blocks: Blocks) -> Errors:
    """Return the figures that decide alone, which is quicker."""
    error, missing, u, *_ = _error(problem, solution)
    bound = length(problem.q if isinstance(problem, Local) else blocks.q)
    return Errors(error, _over(missing, bound), *_own(blocks, u, solution.r))


def _own(blocks: Blocks, u: Vector, r: Vector) -> tuple[float, float, float, float]:
    """Return own_error, scale_free, velocity_error and attainable."""
    found: tuple[float, float, float, float] = compiled(own_errors)(
        blocks.system, u, r, EVERY_SHARE, np.empty_like(r)
    )
    return found


def judged(figures: Figures) -> Errors:
    """Return the figures that decide."""
    return Errors(*(getattr(figures, name) for name in Errors._fields[:-1]))


def _whole(problem: Local | Global, solution: Solution, blocks: Blocks | None) -> Solution:
    """Return a solution with the multipliers and velocities that go with its r, where missing."""
    r = np.ascontiguousarray(solution.r)
    without_l = solution.l is None and problem.equalities > 0
    if without_l or (solution.v is None and isinstance(problem, Global)):
        return completed(problem, r, blocks)
    return Solution(solution.u, r, solution.v, solution.l)


def _error(
    problem: Local | Global, solution: Solution
) -> tuple[float, float, Vector, float, float, float]:
    """Return error, |F|, u and the residuals that `_velocities` gives."""
    u, scales, dynamics, equalities, absolute = _velocities(problem, solution)
    tangent, rolling = directions(problem)
    mu_r = np.zeros(problem.contacts) if problem.mu_r is None else problem.mu_r
    missing = float(
        compiled(residual)(
            tangent, rolling, problem.mu, mu_r, u, solution.r, np.empty_like(solution.r)
        )
    )
    error = _over(missing, max(scales)) + dynamics + equalities
    return error, missing, u, dynamics, equalities, absolute


def _over(value: float, scale: float) -> float:
    """Return a quotient; a scale of 0 does not divide."""
    return value / scale if scale > 0.0 else value


def _velocities(
    problem: Local | Global, solution: Solution
) -> tuple[Vector, tuple[float, ...], float, float, float]:
    """Return u, the scales of F, and the residuals of the linear equations.

    These are: relative ones of the dynamics and of the equality constraints, and MERIT_1's of the
    latter.
    """
    r, l = solution.r, solution.l  # noqa: E741  FCLIB's name
    equalities, absolute = 0.0, 0.0
    if isinstance(problem, Local):
        u = times(problem.W, r) + problem.q
        if problem.V is not None and problem.R is not None and problem.s is not None:
            assert l is not None
            u = u + times(problem.V, l)
            parts = (transposed_times(problem.V, r), times(problem.R, l), problem.s)
            left = length(parts[0] + parts[1] + parts[2])
            equalities = _over(left, max(length(part) for part in parts))
            absolute = left / (1.0 + length(problem.s))
        return u, (length(problem.q), length(r), length(u)), 0.0, equalities, absolute
    v = solution.v
    assert v is not None
    u = transposed_times(problem.H, v) + problem.w
    forces = [times(problem.M, v), -times(problem.H, r), -problem.f]
    if problem.G is not None and problem.b is not None:
        assert l is not None
        forces.append(-times(problem.G, l))
        left = length(transposed_times(problem.G, v) + problem.b)
        # G' v may cancel to nothing: its terms are the scale
        terms = transposed_times(replace(problem.G, x=np.abs(problem.G.x)), np.abs(v))
        equalities = _over(left, max(length(terms), length(problem.b)))
        absolute = left / (1.0 + length(problem.b))
    total = functools.reduce(np.add, forces)
    dynamics = _over(length(total), max(length(force) for force in forces))
    return u, (length(u), length(r)), dynamics, equalities, absolute


def _figures(problem: Local | Global, u: Vector, r: Vector, q: Vector) -> tuple[Any, ...]:
    """Return the figures from `max_cone_violation` on."""
    nc, d = problem.contacts, problem.spacedim
    if nc == 0:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(0, np.int64))
    tangent, _ = directions(problem)
    nt = len(tangent)
    us, rs, qs = (vector.reshape(nc, d) for vector in (u, r, q))
    speed, friction = _lengths(us[:, 1 : 1 + nt]), _lengths(rs[:, 1 : 1 + nt])
    spin, moment = _lengths(us[:, 1 + nt :]), _lengths(rs[:, 1 + nt :])
    mu = problem.mu
    mu_r = np.zeros(nc) if problem.mu_r is None else problem.mu_r
    shifted = us[:, 0] + mu * speed + mu_r * spin
    power = np.abs(shifted * rs[:, 0] + np.einsum("ij,ij->i", us[:, 1:], rs[:, 1:]))
    largest_r, largest_u = float(_lengths(rs).max()), float(_lengths(us).max())
    held = rs[:, 0].clip(min=0.0)
    outside = np.maximum(np.maximum(friction - mu * held, moment - mu_r * held), -rs[:, 0])
    penetration = max(0.0, float(-us[:, 0].min()))
    # each on its own scale, so that units do not matter
    scale = max(largest_u, float(_lengths(qs).max()))
    normal_r, normal_u = _each(rs[:, 0], largest_r), _each(us[:, 0], scale)
    room, moving = _each(mu * held - friction, largest_r), _each(speed, scale)
    slips = (room <= moving) & (moving > AT_REST)
    states = np.where(normal_r <= normal_u, OPEN, np.where(slips, SLIP, STICK))
    return (
        _over(max(0.0, float(outside.max())), largest_r),
        penetration,
        _over(penetration, float(_lengths(qs).max())),
        _over(float(power.max()), largest_r * largest_u),
        largest_r,
        length(r),
        states,
    )


def _lengths(rows: Any) -> Any:
    """Return the length of every row."""
    return np.sqrt(np.einsum("ij,ij->i", rows, rows))


def _each(values: Any, scale: float) -> Any:
    """Return values over a scale; a scale of 0 does not divide."""
    return values / scale if scale > 0.0 else values

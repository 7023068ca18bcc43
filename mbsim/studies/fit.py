"""Least squares from one start: SciPy's trust-region reflective method on curves of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsim.studies.columns import Columns
from mbsim.studies.differences import NoDifference
from mbsim.studies.distributions import Numbers
from mbsim.studies.rounds import Asking, Stopped

if TYPE_CHECKING:
    from mbsim.studies.problem import Problem

#: The fit ends where an iteration lowers the sum of squares by less, in units of one row's share:
#: by then a parameter moves by three hundredths of its standard deviation.
_SHARE = 1e-3
#: Or where it moves by less than this part of the point's size.
_XTOL = 1e-7


@dataclass
class Fit:
    """Where a fit came to.

    Attributes
    ----------
    start, z : array, (unknowns,)
        Where it began, and the best point so far, in the unit cube.
    cost : float
        Weighted sum of squares there, priors included; infinite if no run has come to its end.
    curves : array, (rows,), optional
        Of the run there.
    ended : str
        Why it did: "converged", "most iterations", "stopped", "failed".
    reason : str
        Of a failure, in words.
    stepped_back : int
        How many trial points it went back from because their runs failed.
    columns : Columns, optional
        What its slopes were from.
    """

    start: Numbers
    z: Numbers
    cost: float = np.inf
    curves: Numbers | None = None
    ended: str = "stopped"
    reason: str = ""
    iterations: int = 0
    stepped_back: int = 0
    columns: Columns | None = None


def residuals(problem: Problem, z: Numbers, curves: Numbers) -> Numbers:
    """Return what is squared and summed up, (rows + priors + bends,), in this order.

    A residual is how far a run is off in standard deviations of the noise, times the square root
    of the record's weight; of unknown curves it is their second derivatives over what these may be.
    """
    off = (curves - problem.measured) / problem.sd * np.sqrt(problem.weight)
    surprises = [problem.unknowns[k].surprise(float(z[k]))[0] for k in problem.priors]
    values = np.array(list(problem.values(z).values()))
    return np.concatenate([off, surprises, problem.bends @ values])


def rows_of(problem: Problem, z: Numbers, columns: Numbers) -> Numbers:
    """Return the slopes of `residuals`, (its size, unknowns), of those of the curves."""
    slopes = columns / problem.sd[:, None] * np.sqrt(problem.weight)[:, None]
    others = np.zeros((len(problem.priors), len(z)))
    for row, k in enumerate(problem.priors):
        others[row, k] = problem.unknowns[k].surprise(float(z[k]))[1]
    wide = [unknown.slope(float(at)) for unknown, at in zip(problem.unknowns, z, strict=True)]
    return np.concatenate([slopes, others, problem.bends * np.array(wide)])


def fit_from(problem: Problem, start: Numbers, fit: Fit, ask: Asking) -> Fit:
    """Fit from a start, `fit` being kept up to date as it goes, and return it."""
    from scipy.optimize import least_squares

    count = len(problem.measured) + len(problem.priors) + len(problem.bends)
    nothing = np.full(count, np.nan)

    def at(z: Numbers) -> Numbers:
        curves = ask([z])[0]
        if curves is None:
            fit.stepped_back += 1
            return nothing  # the trust region shrinks
        off = residuals(problem, z, curves)
        if (cost := float(off @ off)) < fit.cost:
            fit.z, fit.cost, fit.curves = z.copy(), cost, curves
        return off

    def slopes(z: Numbers) -> Numbers:
        curves = ask([z])[0]  # run already
        assert curves is not None
        fit.iterations += 1
        if fit.iterations == 1:
            sd = problem.sd if problem.is_stated else None
            return rows_of(problem, z, columns.checked(ask, z, curves, sd).columns)
        return rows_of(problem, z, columns.at(ask, z, curves))

    fit.columns = columns = Columns(problem)
    # the method begins between the bounds
    inside = np.clip(start, 1e-6, 1.0 - 1e-6)
    try:
        if not np.all(np.isfinite(at(inside))):
            fit.ended, fit.reason = "failed", "the run at the start failed"
            return fit
        found = least_squares(
            at,
            inside,
            slopes,
            bounds=(0.0, 1.0),
            x_scale="jac",
            ftol=max(_SHARE / count, 1e-12),
            xtol=_XTOL,
            gtol=1e-12,
            max_nfev=problem.most_iterations,
        )
    except Stopped:
        return fit
    except NoDifference as error:
        fit.ended, fit.reason = "failed", str(error)
        return fit
    fit.ended = "converged" if found.status > 0 else "most iterations"
    return fit

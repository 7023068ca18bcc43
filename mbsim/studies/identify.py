"""`identify`: parameters of a deck fitted to measured curves, and what the fit is worth."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mbsim.errors import Interrupted, ResultsError, SolverError
from mbsim.studies.columns import Columns
from mbsim.studies.differences import Checked, NoDifference
from mbsim.studies.distributions import Numbers
from mbsim.studies.fit import Fit, fit_from
from mbsim.studies.judge import Judged, judge, linearity
from mbsim.studies.local import Workers
from mbsim.studies.rounds import Asking, Progress, Rounds, Stopped
from mbsim.studies.sweep import processors
from mbsim.studies.worker import Pool

if TYPE_CHECKING:
    from mbsim.studies.problem import Problem

#: Fits whose sums of squares differ by less, in squares of s, are equally good.
_EQUAL = 4.0
#: What a standard deviation along a direction may add, where it would add 1, for curves that are
#: nearly linear.
_LINEAR = (0.4, 2.5)
#: Nearer points of the unit cube, by their largest difference in standard deviations, are one.
_SAME = 3.0


@dataclass(frozen=True)
class Identified:
    """What came of it.

    Attributes
    ----------
    problem : Problem
    best : Fit
    fits : list of Fit
        Of all starts, in their order.
    judged : Judged, optional
        None where it was stopped before runs beside the best point were made.
    added : list of float
        What a standard deviation along each seen direction adds to the sum of squares: about 1.
    runs : int
    reasons : list of (int, str)
        Why runs failed: how many, and why, the most frequent first.
    warnings : list of str
    stopped : bool
        Whether Ctrl-C came, or a scheduler does not answer any more.
    stopped_by : int
        The number of the signal, 0: it was the scheduler.
    """

    problem: Problem
    best: Fit
    fits: list[Fit]
    judged: Judged | None
    added: list[float]
    runs: int
    reasons: list[tuple[int, str]]
    warnings: list[str]
    stopped: bool
    stopped_by: int = signal.SIGINT


def pool_of(
    problem: Problem,
    workers: int | None = None,
    scheduler: str | None = None,
    notify: Callable[[str], None] | None = None,
) -> Pool:
    """Return who runs a problem: local processes, one a processor, or a Dask cluster.

    `notify` is called with lines for the user while it waits.

    Raises
    ------
    ModelError
        If no scheduler answers there.
    """
    if scheduler is not None:
        from mbsim.studies.cluster import Cluster

        return Cluster(problem.study, scheduler, notify)
    return Workers(problem.study, workers or processors())


def identify(problem: Problem, pool: Pool, progress: Progress | None = None) -> Identified:
    """Fit the parameters of a problem.

    Parameters
    ----------
    problem : Problem
    pool : Pool
        Let go of at the end.
    progress : callable, optional
        Called with how many runs were made.

    Returns
    -------
    Identified
        After Ctrl-C with the best so far.

    Raises
    ------
    SolverError
        If the run at every start failed.
    Interrupted
        If Ctrl-C came before the first run was done.
    ResultsError
        If a scheduler did not answer any more before that.
    """
    starts = problem.start_points()
    fits = [Fit(start=start, z=start.copy()) for start in starts]
    with closing(pool):
        rounds = Rounds(problem, pool, progress)
        works: list[Callable[[Asking], Fit]] = [
            partial(fit_from, problem, fit.start, fit) for fit in fits
        ]
        _raise_ours(rounds.drive(works))
        best = min(fits, key=lambda fit: fit.cost)
        reasons = [(count, why) for why, count in rounds.reasons.most_common()]
        if best.curves is None:
            if rounds.stopped:
                if rounds.signal == 0:
                    raise ResultsError(f"{rounds.notes[-1]}: no run was done")
                raise Interrupted("interrupted before the first run was done", rounds.signal)
            why = f": {reasons[0][1]}" if reasons else ""
            raise SolverError(f"{problem.study.file}: the run at every start failed{why}")
        judged, added, notes = _judged(problem, best, rounds)
    reasons = [(count, why) for why, count in rounds.reasons.most_common()]
    warnings = [*notes, *_about_fits(problem, best, fits, judged), *rounds.notes]
    warnings += [f"{count} runs warned: {why}" for why, count in rounds.warnings.most_common(3)]
    if judged is not None:
        warnings = [*judged.warnings, *warnings]
    about = (rounds.runs, reasons, warnings, rounds.stopped, rounds.signal)
    return Identified(problem, best, fits, judged, added, *about)


def _raise_ours(found: list[Fit | Exception]) -> None:
    """Raise what a fit raised that is no end of one."""
    for each in found:
        if isinstance(each, Exception) and not isinstance(each, Stopped):
            raise each


def _judged(
    problem: Problem, best: Fit, rounds: Rounds
) -> tuple[Judged | None, list[float], list[str]]:
    """Return what the best fit is worth, how linear it is there, and what is to be said."""
    curves = best.curves
    assert curves is not None
    sd = problem.sd if problem.is_stated else None
    if sd is not None and best.cost > 2.0 * len(curves):
        sd = None  # it is not the noise that decides
    columns = best.columns or Columns(problem)
    (checked,) = rounds.drive([lambda ask: columns.checked(ask, best.z, curves, sd)])
    if isinstance(checked, Stopped):
        return None, [], ["stopped before runs beside the best point: no covariance"]
    if isinstance(checked, NoDifference):
        return None, [], [f"no covariance: {checked}"]
    if isinstance(checked, Exception):
        raise checked
    judged = judge(problem, best, checked)
    notes = [
        f"{name}: {said.replace('them', 'differences')}, which are taken"
        for name, said in columns.disagree.items()
    ]
    added, bent = _linear(problem, best, judged, rounds)
    return judged, added, [*notes, *_about_steps(problem, checked, judged), *bent]


def _linear(
    problem: Problem, best: Fit, judged: Judged, rounds: Rounds
) -> tuple[list[float], list[str]]:
    """Return what a standard deviation along each seen direction adds, and what is to be said."""
    beside = {
        (k, side): best.z + side * axis
        for k, axis in enumerate(judged.axes)
        for side in (1, -1)
        if np.all((best.z + side * axis >= 0.0) & (best.z + side * axis <= 1.0))
    }
    (answers,) = rounds.drive([lambda ask: ask(list(beside.values()))])
    if isinstance(answers, Stopped):
        return [], ["stopped before the check that curves are linear"]
    if isinstance(answers, Exception):
        raise answers
    added = linearity(problem, best, judged, dict(zip(beside, answers, strict=True)))
    seen = [direction for direction in judged.directions if direction.seen]
    notes = [
        f"{direction.text}: a standard deviation adds {value:.2g} to the sum of squares, not 1: "
        "the curves bend, and standard deviations are rough"
        for direction, value in zip(seen, added, strict=True)
        if np.isfinite(value) and not _LINEAR[0] <= value <= _LINEAR[1]
    ]
    return added, notes


def _about_steps(problem: Problem, checked: Checked, judged: Judged) -> list[str]:
    """Return what is to be said of differences that are rough."""
    return [
        f"{parameter.name}: differences over two steps are off by {off:.1%}: so is its "
        "standard deviation; a smaller run.tol may help"
        for parameter, off in zip(judged.parameters, checked.discrepancy, strict=True)
        if off > 0.05 and not parameter.why
    ]


def _about_fits(problem: Problem, best: Fit, fits: list[Fit], judged: Judged | None) -> list[str]:
    """Return what is to be said of how fits ended."""
    lines = []
    if best.ended == "most iterations":
        lines.append(f"not converged after {problem.most_iterations} iterations")
    if best.ended == "failed":
        lines.append(f"the fit ended: {best.reason}")
    if best.stepped_back:
        lines.append(f"{best.stepped_back} trial points failed: the fit stepped back from them")
    if failed := sum(fit.curves is None for fit in fits):
        lines.append(f"{failed} of {len(fits)} starts failed")
    if judged is None or len(fits) == 1:
        return lines
    sd = np.array([max(_sd(judged, k), 1e-6) for k in range(len(best.z))])
    others = [
        fit
        for fit in fits
        if fit.cost - best.cost < _EQUAL * judged.misfit.s**2
        and float(np.max(np.abs(fit.z - best.z) / sd)) > _SAME
    ]
    if others:
        values = ", ".join(f"{n} = {v:.4g}" for n, v in problem.values(others[0].z).items())
        lines.append(f"another point fits as well: {values}: the estimate is not the only one")
    return lines


def _sd(judged: Judged, k: int) -> float:
    """Return how uncertain an unknown is in the unit cube, by seen directions; 1 if not seen."""
    name = judged.parameters[k].name
    if judged.parameters[k].why == "not seen":
        return 1.0
    parts = [d.sd * d.components[name] for d in judged.directions if d.seen]
    return float(np.linalg.norm(parts)) if parts else 1.0


def values_of(problem: Problem, z: Numbers) -> dict[str, str]:
    """Return what a point sets in the deck, by ``Element[id].attribute``."""
    return problem.study.overrides(problem.values(z))

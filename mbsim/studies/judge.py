"""What a fit is worth: covariance, what records do not see, whether the model explains them.

With residuals r in standard deviations of the noise, of slope J, the estimate has the covariance
s^2 (J'J)^-1: where the model is right, the noise independent from row to row, and the curves nearly
linear over a standard deviation (Seber & Wild, Nonlinear Regression, 1989, ch. 2 and 5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.studies.differences import Checked
from mbsim.studies.distributions import Numbers
from mbsim.studies.fit import Fit, residuals, rows_of

if TYPE_CHECKING:
    from mbsim.studies.problem import Problem

Truths = np.ndarray[Any, np.dtype[np.bool_]]

#: Standard deviation of what is known to lie between the bounds and no more, as a part of them: a
#: parameter or combination that the records do not place better is not seen.
UNSEEN = 1.0 / math.sqrt(12.0)
#: A misfit that chance makes less often is none of chance; one less often beaten is too good.
LEAST_CHANCE = 1e-3
#: Correlation of neighbouring residuals in its own standard deviations from which they hang
#: together.
_HANG_TOGETHER = 4.0
#: Nearer to a bound, as a part of the range, with the fit pushing on, is at it.
_AT_BOUND = 2e-3
#: Two steps of a difference that differ by more say nothing of the column.
UNSETTLED = 0.3
#: Most that a combination is uncertain, in ranges: what records do not depend on at all.
_MOST = 1e6
#: Components of a combination that are named.
_NAMED = 0.15


@dataclass(frozen=True)
class Parameter:
    """What is known of a parameter.

    `estimate`, `sd` and `interval` (95 %) are None where that would be false confidence, and `why`
    says it: "", "not seen", "at its lower bound", "at its upper bound", "not settled".
    """

    name: str
    value: float
    estimate: float | None
    sd: float | None
    interval: tuple[float, float] | None
    why: str


@dataclass(frozen=True)
class Direction:
    """A combination of parameters, by its components in parts of their ranges, largest first.

    `singular_value` is of the scaled Jacobian, `sd` how far the combination is uncertain as a part
    of the range (infinite where the records do not depend on it).
    """

    components: dict[str, float]
    singular_value: float
    sd: float

    @property
    def seen(self) -> bool:
        """Whether the records place it better than the bounds do."""
        return self.sd <= UNSEEN

    @property
    def text(self) -> str:
        """The combination in words: ``0.71 mu_s - 0.70 mu_d``."""
        named = [(n, c) for n, c in self.components.items() if abs(c) >= _NAMED]
        words = " ".join(f"{'+' if c > 0 else '-'} {abs(c):.2f} {n}" for n, c in named)
        return words.removeprefix("+ ")


@dataclass(frozen=True)
class RecordFit:
    """How a record is met: arrays of (rows,), `band` being the half width of 95 % of the curve."""

    name: str
    unit: str
    time: Numbers
    measured: Numbers
    fitted: Numbers
    band: Numbers
    sd: Numbers | None
    rms: float
    correlation: float
    hangs_together: bool
    worst: tuple[float, float]


@dataclass(frozen=True)
class Misfit:
    """How far the model is from the records.

    `chi_square` and its `probability` are None where the noise is not stated; `s` is the factor on
    the stated noise, or without one the noise as it follows from the residuals, as a part of the
    record's range. `explained` is None where it cannot be told.
    """

    chi_square: float | None
    degrees_of_freedom: float
    probability: float | None
    s: float
    explained: bool
    text: str


@dataclass(frozen=True)
class Judged:
    """All that is known of a fit; matrices over the parameters, NaN where nothing is known."""

    parameters: list[Parameter]
    covariance: Numbers
    correlation: Numbers
    directions: list[Direction]
    records: list[RecordFit]
    misfit: Misfit
    steps: Numbers
    discrepancy: Numbers
    sources: tuple[str, ...]
    axes: Numbers  # (directions, unknowns): of the unit cube, a standard deviation long
    warnings: list[str]


def judge(problem: Problem, fit: Fit, checked: Checked) -> Judged:
    """Return what a fit is worth.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        With the curves at its best point.
    checked : Checked
        The slopes there.
    """
    assert fit.curves is not None
    names = [unknown.name for unknown in problem.unknowns]
    rows, off = rows_of(problem, fit.z, checked.columns), residuals(problem, fit.z, fit.curves)
    noise = 1.0 if problem.is_stated else float(np.sqrt(np.mean(off * off)))
    # of a column that is too small to be seen, noise of the runs does not matter
    large = np.linalg.norm(rows, axis=0) * UNSEEN > noise
    unsettled = (checked.discrepancy > UNSETTLED) & large
    columns = np.where(unsettled, 0.0, checked.columns)
    rows = rows_of(problem, fit.z, columns)
    free = ~(_at_bounds(fit.z, rows.T @ off) & large)
    plain = (off / np.sqrt(_weights(problem)))[: len(off) - len(problem.bends)]
    # what the noise is stated to be decides what is seen, unless the residuals are larger
    directions, degrees, s = _directions(problem, rows, plain, free, names)
    covariance, unbound = _covariance(problem, rows, directions, s, names)
    spread = np.sqrt(np.diag(covariance))
    seen = unbound <= UNSEEN
    records = _records(problem, fit, columns, covariance, degrees)
    misfit = _misfit(problem, plain, degrees, s, records)
    parameters = [
        _parameter(problem, k, fit.z, float(spread[k]), why, degrees)
        for k, why in enumerate(_whys(fit.z, seen, free, unsettled))
    ]
    known = np.array([p.sd is not None for p in parameters])
    scale = np.array([u.slope(float(z)) for u, z in zip(problem.unknowns, fit.z, strict=True)])
    both = known[:, None] & known[None, :]
    size = np.where(known & (spread > 0.0), spread, 1.0)
    found = Judged(
        parameters=parameters,
        covariance=np.where(both, covariance * np.outer(scale, scale), np.nan),
        correlation=np.where(both, covariance / np.outer(size, size), np.nan),
        directions=directions,
        records=records,
        misfit=misfit,
        steps=checked.steps,
        discrepancy=checked.discrepancy,
        sources=checked.sources,
        axes=np.array([[d.sd * d.components[n] for n in names] for d in directions if d.seen]),
        warnings=[],
    )
    found.warnings.extend(_warnings(problem, found))
    return found


def _weights(problem: Problem) -> Numbers:
    """Return the weights of all rows of `residuals`; of priors and of what bends 1."""
    others = len(problem.priors) + len(problem.bends)
    return np.concatenate([problem.weight, np.ones(others)])


def _at_bounds(z: Numbers, push: Numbers) -> Truths:
    """Return which unknowns are at a bound with the fit pushing on; `push` is the gradient."""
    below = (z < _AT_BOUND) & (push > 0.0)
    above = (z > 1.0 - _AT_BOUND) & (push < 0.0)
    return np.asarray(below | above)


def _directions(
    problem: Problem, rows: Numbers, plain: Numbers, free: Truths, names: list[str]
) -> tuple[list[Direction], float, float]:
    """Return the combinations from the best seen on, degrees of freedom, and the factor s.

    A combination takes as much of a degree as it owes to other rows than those that keep unknown
    curves smooth (effective number of parameters; T. Hastie, R. Tibshirani, Generalized Additive
    Models, 1990, section 3.5).
    """
    _, sizes, axes = np.linalg.svd(rows * free, full_matrices=False)
    keep = [k for k in range(len(sizes)) if np.linalg.norm(axes[k] * free) > 0.5]
    sizes, axes = sizes[keep], axes[keep]
    kept_smooth = rows[len(plain) :] @ (axes * free).T / np.maximum(sizes, 1e-300)
    takes = 1.0 - np.sum(kept_smooth**2, axis=0)
    seen_count, s, degrees = len(sizes), 1.0, 1.0
    for _ in range(len(sizes) + 1):
        degrees = max(len(plain) - float(np.sum(takes[:seen_count])), 1.0)
        s = math.sqrt(float(plain @ plain) / degrees)
        if problem.is_stated:
            from scipy.stats import chi2

            chance = float(chi2.sf(float(plain @ plain), degrees))
            s = max(s, 1.0) if chance < LEAST_CHANCE else 1.0
        last, seen_count = seen_count, int(np.sum(s <= UNSEEN * sizes))
        if seen_count == last:
            break
    found = []
    for size, axis in zip(sizes, axes, strict=True):
        order = np.argsort(-np.abs(axis))
        axis = axis * (1.0 if axis[order[0]] > 0.0 else -1.0)
        noise = 1e-13 * float(sizes[0])
        sd = s / float(size) if size > noise else math.inf
        found.append(Direction({names[k]: float(axis[k]) for k in order}, float(size), sd))
    return found, degrees if problem.unknown_curves else round(degrees), s


def _covariance(
    problem: Problem, rows: Numbers, directions: list[Direction], s: float, names: list[str]
) -> tuple[Numbers, Numbers]:
    """Return the covariance in the unit cube, and standard deviations as if there were no bounds.

    With weights it is that of the weighted estimate: (J'WJ)^-1 J'W^2 J (J'WJ)^-1. A combination
    that is not seen is as uncertain as between the bounds.
    """
    axes = np.array([[d.components[name] for name in names] for d in directions])
    axes = axes.reshape(len(directions), len(names))
    size = np.array([d.singular_value for d in directions])
    seen = np.array([d.seen for d in directions], dtype=bool)
    inverse = axes[seen].T / size[seen] ** 2 @ axes[seen] if seen.any() else 0.0 * axes.T @ axes
    middle = (rows * _weights(problem)[:, None]).T @ rows
    covariance = s * s * inverse @ middle @ inverse
    unbound = np.diag(covariance).copy()
    for k in np.flatnonzero(~seen):
        covariance = covariance + UNSEEN**2 * np.outer(axes[k], axes[k])
        unbound += (axes[k] * min(directions[k].sd, _MOST)) ** 2
    return covariance, np.sqrt(unbound)


def _quantile(problem: Problem, degrees: float) -> float:
    """Return how many standard deviations hold 95 % to both sides."""
    from scipy.stats import norm, t

    return float(norm.ppf(0.975) if problem.is_stated else t.ppf(0.975, degrees))


def _whys(z: Numbers, seen: Truths, free: Truths, unsettled: Truths) -> list[str]:
    """Return why each parameter has no standard deviation, as `Parameter` has it."""
    whys = []
    for k, place in enumerate(z):
        why = "" if seen[k] else "not seen"
        if not free[k]:
            why = f"at its {'lower' if place < 0.5 else 'upper'} bound"
        whys.append("not settled" if unsettled[k] else why)
    return whys


def _parameter(
    problem: Problem,
    k: int,
    z: Numbers,
    spread: float,
    why: str,
    degrees: float,
) -> Parameter:
    """Return what is known of a parameter; `why` as `Parameter` has it."""
    unknown, place = problem.unknowns[k], float(z[k])
    value = unknown.value(place)
    if why:
        kept = value if why.startswith("at") else None
        return Parameter(unknown.name, value, kept, None, None, why)
    wide = _quantile(problem, degrees) * spread * unknown.width
    interval = (value - wide, value + wide)
    if unknown.log:
        interval = (value * math.exp(-wide), value * math.exp(wide))
    return Parameter(unknown.name, value, value, spread * unknown.slope(place), interval, "")


def _records(
    problem: Problem, fit: Fit, columns: Numbers, covariance: Numbers, degrees: float
) -> list[RecordFit]:
    """Return how each record is met."""
    assert fit.curves is not None
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    band = _quantile(problem, degrees) * np.sqrt(np.maximum(variance, 0.0))
    found, first = [], 0
    for record in problem.records:
        part = slice(first, first + len(record.value))
        first = part.stop
        left = record.value - fit.curves[part]
        scaled = left if record.sd is None else left / record.sd
        worst = int(np.argmax(np.abs(scaled)))
        together = _correlation(scaled)
        found.append(
            RecordFit(
                name=record.name,
                unit=record.unit,
                time=record.time,
                measured=record.value,
                fitted=fit.curves[part],
                band=band[part],
                sd=record.sd,
                rms=float(np.sqrt(np.mean(left * left))),
                correlation=together,
                hangs_together=together * math.sqrt(len(scaled)) > _HANG_TOGETHER,
                worst=(float(record.time[worst]), float(left[worst])),
            )
        )
    return found


def _correlation(left: Numbers) -> float:
    """Return the correlation of each residual with the next; 0 where all are 0."""
    total = float(left @ left)
    return float(left[1:] @ left[:-1]) / total if total > 0.0 else 0.0


def _misfit(
    problem: Problem, plain: Numbers, degrees: float, s: float, records: list[RecordFit]
) -> Misfit:
    """Return whether the model explains the records."""
    together = [record for record in records if record.hangs_together]
    names = ", ".join(record.name for record in together)
    says = (
        f"residuals of {names} hang together from row to row (correlation "
        f"{', '.join(f'{record.correlation:.2f}' for record in together)})"
    )
    if not problem.is_stated:
        text = "the noise is not stated: whether the misfit is noise shows in the residuals only"
        if together:
            text = f"the model does not explain the record: {says}"
        return Misfit(None, degrees, None, s, not together, text)
    from scipy.stats import chi2

    total = float(plain @ plain)
    chance = float(chi2.sf(total, degrees))
    about = (
        f"chi-square {total:.4g} with {round(degrees, 1)} degrees of freedom, "
        f"probability {chance:.2g}"
    )
    explained = chance >= LEAST_CHANCE and not together
    if chance < LEAST_CHANCE:
        text = f"the model does not explain the record: {about}"
        text += f"; {says}" if together else ""
    elif together:
        text = f"the model does not explain the record: {says}, though its size is that of noise"
    elif 1.0 - chance < LEAST_CHANCE:
        text = f"the model explains the record better than the stated noise allows: {about}"
    else:
        text = f"the model explains the record: {about}"
    return Misfit(total, degrees, chance, s, explained, text)


def _warnings(problem: Problem, found: Judged) -> list[str]:
    """Return what must not be overlooked."""
    lines = [] if found.misfit.explained else [found.misfit.text]
    if not found.misfit.explained:
        lines.append(
            "standard deviations and bands hold for a model that is right; this one is not, and "
            "they say too little"
        )
    for parameter in found.parameters:
        if parameter.why == "not seen":
            lines.append(f"{parameter.name}: the record does not see it: it has no estimate")
        elif parameter.why == "not settled":
            lines.append(
                f"{parameter.name}: runs that differ in it by two steps disagree: it has no "
                "estimate; a smaller run.tol, or a shorter record, may help"
            )
        elif parameter.why:
            lines.append(
                f"{parameter.name}: {parameter.why}, {parameter.value:g}: it has no standard "
                "deviation, and those of the others hold for it being there"
            )
    lines += [
        f"not seen: {direction.text} (in parts of the ranges)"
        for direction in found.directions
        if not direction.seen and sum(abs(c) >= _NAMED for c in direction.components.values()) > 1
    ]
    return lines


def linearity(
    problem: Problem, fit: Fit, found: Judged, at: dict[tuple[int, int], Numbers | None]
) -> list[float]:
    """Return what a standard deviation along each seen direction adds to the sum of squares.

    In units of what it would add if curves were linear: 1; NaN where no run tells.

    Parameters
    ----------
    at : dict
        Curves at z + side*axis by direction and side, 1 and -1.
    """
    assert fit.curves is not None
    added = []
    for k, axis in enumerate(found.axes):
        grown = []
        for side in (1, -1):
            curves = at.get((k, side))
            if curves is not None:
                off = residuals(problem, fit.z + side * axis, curves)
                grown.append((float(off @ off) - fit.cost) / found.misfit.s**2)
        added.append(float(np.mean(grown)) if grown else math.nan)
    return added

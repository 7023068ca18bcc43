"""What a study with distributions says of its outputs: bands, and Sobol indices; the home of SALib.

Bands are of the rows that are independent draws of the parameters' distributions. Their standard
errors are those of independent points; a Latin hypercube's and Sobol's sequence's are smaller.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim import __version__
from mbsim.errors import ModelError
from mbsim.studies.designs import SAMPLED, block_length
from mbsim.studies.distributions import Numbers
from mbsim.studies.formulas import Formula

if TYPE_CHECKING:
    from mbsim.studies.study import Study
    from mbsim.studies.table import Responses

SUFFIX = ".uncertainty.json"
#: How the reason begins of an output that varies by rounding only.
NOT_SEEN = "not seen"
#: Parts of all runs below the quantiles of a band.
PARTS = (0.05, 0.5, 0.95)
#: Indices have converged where no 95 % interval is wider than this: Sarrazin, Pianosi & Wagener,
#: Environ. Model. Softw. 79 (2016) 135-152.
NARROW = 0.05
#: Resamplings that intervals of indices are made of, SALib's own choice.
_RESAMPLES = 100
#: How much outputs of several runs differ at least, over their size: below it is rounding, of each
#: step, which add up.
_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
#: An output that varies by less than this part of its size may vary by rounding that something
#: stiff has made larger: it does where its indices are those of noise, which no parameter alone
#: explains and each alone makes anew.
_SMALL, _NONE, _ALL = 1e-6, 0.1, 0.9


def need_salib() -> None:
    """Raise `ModelError`, saying how it is installed, if SALib is not there."""
    if find_spec("SALib") is None:
        raise ModelError('Sobol indices need: pip install "mbsim-contact[studies]"')


def uncertainty(
    study: Study, table: Responses, sizes: Mapping[str, float] | None = None
) -> dict[str, Any] | None:
    """Return bands and Sobol indices of a study's scalar outputs, for JSON.

    None of a study whose design draws from no distributions. What there is no number for is None,
    with a ``reason`` beside it. `sizes` are those of `sizes.output_sizes`.
    """
    if study.design not in SAMPLED or not table.outputs:
        return None
    found: dict[str, Any] = {
        "mbsim": __version__,
        "study": str(study.file),
        "design": study.design,
        "runs": len(table),
        "bands": {name: bands(independent(study, table[name])) for name in table.outputs},
    }
    if study.design == "saltelli":
        found["indices"] = _indices(study, table, sizes or {})
    return found


def _indices(study: Study, table: Responses, sizes: Mapping[str, float]) -> dict[str, Any]:
    """Return Sobol indices by output."""
    steps = int(np.max(table["steps"], initial=1))
    formulas = {output.name: output.formula for output in study.outputs if output.formula}
    found: dict[str, Any] = {}
    for name in table.outputs:
        size = sizes.get(name, 0.0)
        each = sobol_indices(table[name], table.parameters, study.seed, size, steps)
        if name in formulas and "reason" not in each:
            known = {*table.parameters, *table.outputs}
            used = Formula(formulas[name], known).names & known
            if used and all(_is_unseen(found.get(other, {})) for other in used):
                each = {"reason": f"{NOT_SEEN}: it is made of {', '.join(sorted(used))}"}
        found[name] = each
    return found


def _is_unseen(index: Mapping[str, Any]) -> bool:
    """Return whether an output has no indices because it varies by rounding."""
    return str(index.get("reason", "")).startswith(NOT_SEEN)


def independent(study: Study, values: Numbers) -> Numbers:
    """Return the values, (n,), of those runs that are independent draws.

    Of a Saltelli design these are the first and the last run of every block; the others mix these
    two's parameters.
    """
    if study.design != "saltelli":
        return values
    length = block_length(study)
    return values.reshape(-1, length)[:, [0, -1]].ravel()


def bands(values: Numbers) -> dict[str, Any]:
    """Return mean, standard deviation and quantiles of an output, and how sure they are.

    Parameters
    ----------
    values : (n,) array
        Of independent runs; what is not finite is missing, and counted.

    Returns
    -------
    dict
        ``used``, ``missing``; ``mean``, ``mean_se``, ``sd``, ``sd_se``: standard errors of any
        distribution, that of `sd` to the first order; ``quantiles``: of each of `PARTS` the
        ``value`` (Hyndman & Fan's 8th definition, Am. Stat. 50 (1996) 361-365) and ``interval_95``
        between two of the runs (David & Nagaraja, Order Statistics, 3rd ed., 7.1), None where
        the runs are too few to have one.
    """
    x = values[np.isfinite(values)]
    n = len(x)
    about: dict[str, Any] = {"used": n, "missing": len(values) - n}
    if n < 2:
        return {**about, "reason": f"a band needs 2 runs; {n} of {len(values)} have a value"}
    size = float(np.max(np.abs(x))) or 1.0
    mean = float(np.mean(x / size))
    apart = x / size - mean
    s = math.sqrt(float(np.sum(apart**2)) / (n - 1))
    fourth = float(np.mean(apart**4))
    of_square = math.sqrt(max(fourth - s**4 * (n - 3) / (n - 1), 0.0) / n)
    quantiles = np.quantile(x, PARTS, method="median_unbiased").tolist()
    return {
        **about,
        "mean": size * mean,
        "mean_se": size * s / math.sqrt(n),
        "sd": size * s,
        "sd_se": size * of_square / (2.0 * s) if s > 0.0 else 0.0,
        "quantiles": [
            {"part": part, "value": value, "interval_95": _interval(np.sort(x), part)}
            for part, value in zip(PARTS, quantiles, strict=True)
        ],
    }


def _interval(x: Numbers, part: float) -> list[float] | None:
    """Return the 95 % interval of a quantile of sorted values, of any distribution."""
    from scipy.stats import binom

    low, high = (int(binom.ppf(p, len(x), part)) for p in (0.025, 0.975))
    return [float(x[low - 1]), float(x[high])] if low > 0 and high < len(x) else None


def sobol_indices(
    values: Numbers, parameters: Sequence[str], seed: int, size: float = 0.0, steps: int = 1
) -> dict[str, Any]:
    """Return first-order and total Sobol indices of an output of a Saltelli design, by SALib.

    Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270; intervals by the bootstrap.

    Parameters
    ----------
    values : (n (p + 2),) array
        In the design's order.
    parameters : sequence of str
        The p names.
    seed : int
        Of the bootstrap.
    size : float
        Of the output's quantity in the model, where it is known.
    steps : int
        Of the longest run: rounding of each adds to that of the others.

    Returns
    -------
    dict
        ``parameters``: of each ``first``, ``total`` and half the widths of their 95 % intervals,
        ``first_95``, ``total_95``; ``blocks``, n; ``widest_interval``; ``converged``: whether that
        is at most `NARROW`. Or the ``reason`` why there are none.

    Raises
    ------
    ModelError
        If SALib is not installed.
    """
    missing = int(np.sum(~np.isfinite(values)))
    if missing:
        return {"reason": f"{missing} of {len(values)} runs have no value; the design needs all"}
    largest = float(np.max(np.abs(values))) or 1.0
    scaled = values / largest
    spread, usual = float(np.ptp(scaled)), max(1.0, size / largest)
    if spread <= _ROUNDING:
        return {"reason": "all runs have the same value"}
    if spread <= _ROUNDING * steps * usual:
        return {
            "reason": f"{NOT_SEEN}: runs differ by {spread * largest:.2g}, which rounding of "
            f"{steps} steps makes of {usual * largest:.2g}"
        }
    need_salib()
    from SALib.analyze import sobol

    problem = {"num_vars": len(parameters), "names": list(parameters)}
    # to SALib the seed 0 is none
    found = sobol.analyze(
        problem, scaled, calc_second_order=False, num_resamples=_RESAMPLES, seed=seed + 1
    )
    columns = {"first": "S1", "first_95": "S1_conf", "total": "ST", "total_95": "ST_conf"}
    alone, together = found["S1"], found["ST"]
    if spread <= _SMALL * usual and np.max(alone) <= _NONE and np.min(together) >= _ALL:
        return {
            "reason": f"{NOT_SEEN}: runs differ by {spread * largest:.2g} of {usual * largest:.2g} "
            "as noise does: no parameter alone explains a tenth of it, each alone changes it"
        }
    widest = 2.0 * float(max(np.max(found["S1_conf"]), np.max(found["ST_conf"])))
    return {
        "parameters": {
            name: {ours: float(found[theirs][k]) for ours, theirs in columns.items()}
            for k, name in enumerate(parameters)
        },
        "blocks": len(values) // (len(parameters) + 2),
        "widest_interval": widest,
        "converged": widest <= NARROW,
    }


def lines_of(about: dict[str, Any]) -> list[str]:
    """Return bands and indices as the lines of tables."""
    heads = ("mean", "+-", "sd", "+-", *(f"{100.0 * part:g} %" for part in PARTS), "runs")
    rows = [("band", *heads)]
    for name, band in about["bands"].items():
        if "reason" not in band:
            numbers = (f"{band[key]:.6g}" for key in ("mean", "mean_se", "sd", "sd_se"))
            rows.append((name, *numbers, *map(_quantile, band["quantiles"]), str(band["used"])))
    found = [*_aligned(rows)] if len(rows) > 1 else []
    rows = [("Sobol index", "parameter", "first", "+-", "total", "+-")]
    for name, each in about.get("indices", {}).items():
        for parameter, index in each.get("parameters", {}).items():
            rows.append((name, parameter, *(f"{value:.4f}" for value in index.values())))
    return [*found, *_aligned(rows)] if len(rows) > 1 else found


def _quantile(about: dict[str, Any]) -> str:
    between = about["interval_95"]
    return f"{about['value']:.6g} " + (
        "[none]" if between is None else f"[{between[0]:.6g}, {between[1]:.6g}]"
    )


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows of cells as lines, columns two blanks apart."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()


def warnings_of(about: dict[str, Any]) -> list[str]:
    """Return what is missing in bands and indices, and which indices have not converged."""
    found: list[str] = []
    for name, band in about["bands"].items():
        if why := band.get("reason"):
            found.append(f"no band of {name}: {why}")
        elif band["missing"]:
            count = band["used"] + band["missing"]
            found.append(
                f"band of {name}: {band['missing']} of {count} runs have no value: "
                "it is that of the others"
            )
    for name, each in about.get("indices", {}).items():
        if why := each.get("reason"):
            found.append(f"no Sobol indices of {name}: {why}")
        elif not each["converged"]:
            found.append(
                f"Sobol indices of {name} have not converged: "
                f"the widest 95 % interval is {each['widest_interval']:.2g}, above {NARROW:g}"
            )
    return found

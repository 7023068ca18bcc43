"""Which values the parameters of a study take in which run; one design a function, by name.

Every design is a function of the study alone: its seed, and nothing of the machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.studies.csv_file import read_csv
from mbsim.studies.distributions import MOST_RUNS, Numbers, Spread

if TYPE_CHECKING:
    from mbsim.studies.study import Study

#: Fewest blocks of a Saltelli design: intervals are resamplings of them.
FEWEST_BLOCKS = 16


def grid(study: Study) -> Numbers:
    """Return every combination of the parameters' levels, the last parameter fastest."""
    levels: list[Numbers] = []
    for name, spread in study.spreads.items():
        try:
            levels.append(spread.levels())
        except ModelError as error:
            raise ModelError(f"parameters.{name}: {error}") from None
    if (size := math.prod(map(len, levels))) > MOST_RUNS:
        raise ModelError(f"a grid of {size} runs; at most {MOST_RUNS}")
    return np.stack([axis.ravel() for axis in np.meshgrid(*levels, indexing="ij")], axis=1)


def latin_hypercube(study: Study) -> Numbers:
    """Return a Latin hypercube: every parameter in every of `runs` equal parts once.

    McKay, Beckman & Conover, Technometrics 21 (1979) 239-245.
    """
    from scipy.stats import qmc

    return _spread(study, _sampler(qmc.LatinHypercube, study).random(study.runs))


def sobol(study: Study) -> Numbers:
    """Return the first `runs` points of Sobol's sequence, scrambled by the seed.

    Sobol, USSR Comp. Math. 7 (1967) 86-112; Owen, J. Complexity 14 (1998) 466-489.
    """
    return _spread(study, _sobol_points(study, len(study.spreads), study.runs))


def _sobol_points(study: Study, axes: int, count: int) -> Any:
    """Return points of Sobol's sequence in the unit cube, (count, axes)."""
    import warnings

    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no power of 2: `Study.notes` says so
        return _sampler(qmc.Sobol, study, axes).random(count)


def block_length(study: Study) -> int:
    """Return how many runs a block of a Saltelli design has."""
    return len(study.spreads) + 2


def saltelli(study: Study) -> Numbers:
    """Return Saltelli's design, which Sobol indices are estimated from, in blocks of runs.

    A block is a point A, A with one parameter after the other from B, and B; A and B are halves of
    a point of Sobol's sequence. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270.

    Raises
    ------
    ModelError
        If `runs` are no whole blocks, or too few.
    """
    length = block_length(study)
    count, rest = divmod(study.runs, length)
    if rest or count < FEWEST_BLOCKS:
        better = max(FEWEST_BLOCKS, 2 ** round(math.log2(max(count, 1))))
        raise ModelError(
            f"study.runs = {study.runs}: saltelli needs a multiple of {length}, parameters + 2, "
            f"and at least {FEWEST_BLOCKS * length}; for example {better * length}"
        )
    number = length - 2
    halves = _sobol_points(study, 2 * number, count)
    blocks = np.repeat(halves[:, None, :number], length, axis=1)
    for k in range(number):
        blocks[:, k + 1, k] = halves[:, number + k]
    blocks[:, -1] = halves[:, number:]
    return _spread(study, blocks.reshape(-1, number))


def _sampler(engine: Any, study: Study, axes: int = 0) -> Any:
    """Return one of SciPy's engines, seeded; SciPy before 1.15 calls its generator `seed`."""
    from inspect import signature

    name = "rng" if "rng" in signature(engine).parameters else "seed"
    return engine(axes or len(study.spreads), **{name: np.random.default_rng(study.seed)})


def random(study: Study) -> Numbers:
    """Return independent points."""
    points = np.random.default_rng(study.seed).random((study.runs, len(study.spreads)))
    return _spread(study, points)


def table(study: Study) -> Numbers:
    """Return the rows of the study's CSV, whose first line names the parameters."""
    assert study.csv is not None
    found = read_csv(study.csv, whole=True)
    if missing := sorted(study.spreads.keys() - found.columns.keys()):
        raise ModelError(f"{study.csv}: no columns {', '.join(missing)}")
    if extra := sorted(found.columns.keys() - study.spreads.keys()):
        raise ModelError(f"{study.csv}: columns of no parameter: {', '.join(extra)}")
    return np.stack([found[name] for name in study.spreads], axis=1)


def _spread(study: Study, points: Any) -> Numbers:
    """Return points of the unit cube as values of the parameters."""
    # 0 and 1 are no values of a distribution without bounds
    tiny = np.finfo(np.float64).eps
    inside = np.clip(points, tiny, 1.0 - tiny)
    spreads: list[Spread] = list(study.spreads.values())
    return np.stack([each.at(inside[:, k]) for k, each in enumerate(spreads)], axis=1)


DESIGNS: dict[str, Callable[[Study], Numbers]] = {
    "grid": grid,
    "latin_hypercube": latin_hypercube,
    "sobol": sobol,
    "random": random,
    "saltelli": saltelli,
    "csv": table,
}
#: Those that draw from the distributions of the parameters.
SAMPLED = ("latin_hypercube", "sobol", "random", "saltelli")

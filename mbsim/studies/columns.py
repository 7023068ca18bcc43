"""Columns of the Jacobian: from sensitivities of runs, or from differences of runs.

Both are made at the first point. A column is from sensitivities where they are known to the end
of the records, agree with differences, and are not more work.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsim.studies.differences import GOOD, Checked, checked_jacobian, slopes
from mbsim.studies.distributions import Numbers
from mbsim.studies.rounds import Asking, Slopes

if TYPE_CHECKING:
    from mbsim.studies.problem import Problem

#: Sensitivities may be off differences by so many times by which two steps are.
_FAR = 10.0
#: Runs of a difference.
_RUNS = 2


class Columns:
    """What the columns of a fit's Jacobian are from.

    Attributes
    ----------
    paths : dict of int to tuple of str
        Attributes of the deck by which runs are derived for an unknown, where it is.
    sources : list of str
        What each column is from, and why.
    disagree : dict
        Unknown -> that its sensitivities were far off differences, for the user.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.paths: dict[int, tuple[str, ...]] = {}
        self.sources: list[str] = []
        self.disagree: dict[str, str] = {}
        self._steps = np.zeros(len(problem.unknowns))
        shifts = {record.offset for record in problem.records}
        for k, unknown in enumerate(problem.unknowns):
            why = ""
            paths = problem.study.set_by(unknown.name)
            if problem.jacobian == "differences":
                why = "as asked"
            elif unknown.name in shifts:
                why = "a time offset has no sensitivity"
            elif paths is None:
                why = "a formula of [set] has it"
            elif paths:
                self.paths[k] = paths
            self.sources.append(f"differences: {why}" if why else "differences")

    def checked(self, ask: Asking, z: Numbers, curves: Numbers, sd: Numbers | None) -> Checked:
        """Return the slopes at z, both ways compared; what `at` does follows from that.

        Parameters
        ----------
        ask : Asking
        z : array, (unknowns,)
        curves : array, (rows,)
            Those at z.
        sd : array, (rows,), optional
            As of `checked_jacobian`.

        Raises
        ------
        NoDifference, Stopped
        """
        found = checked_jacobian(ask, z, curves, sd)
        self._steps = found.steps
        columns = found.columns.copy()
        tried = sorted(self.paths)
        made = dict(zip(tried, ask.slopes(z, [self.paths[k] for k in tried]), strict=True))
        for k, each in made.items():
            column = self._column(each, z, k)
            if column is None:
                self._drop(k, each.why or "no sensitivity")
                continue
            off = np.linalg.norm(column - columns[:, k])
            size = max(float(np.linalg.norm(columns[:, k])), float(np.linalg.norm(column)))
            part = float(off) / size if size > 0.0 else 0.0
            if part > _FAR * max(float(found.discrepancy[k]), GOOD):
                said = f"sensitivities are off them by {part:.2g}"
                self.disagree[self._problem.unknowns[k].name] = said
                self._drop(k, said)
                continue
            columns[:, k] = column
            self.sources[k] = f"sensitivities, which are off differences by {part:.2g}"
        if self._problem.jacobian == "auto":
            self._take_cheaper(made)
            dropped = [k for k in tried if k not in self.paths]
            columns[:, dropped] = found.columns[:, dropped]
        return replace(found, columns=columns, sources=tuple(self.sources))

    def at(self, ask: Asking, z: Numbers, curves: Numbers) -> Numbers:
        """Return the slopes at z, (rows, unknowns), without a check."""
        columns = np.empty((len(curves), len(z)))
        left = set(range(len(z)))
        if self.paths:
            every = tuple(path for paths in self.paths.values() for path in paths)
            (made,) = ask.slopes(z, [every])
            for k in self.paths:
                column = self._column(made, z, k)
                if column is not None:
                    columns[:, k] = column
                    left.remove(k)
        rest = sorted(left)
        for k, column in zip(
            rest, slopes(ask, z, curves, [(k, self._steps[k]) for k in rest]), strict=True
        ):
            columns[:, k] = column
        return columns

    def _column(self, made: Slopes, z: Numbers, k: int) -> Numbers | None:
        """Return the slope of the curves over an unknown, None where it is not known."""
        if any(path not in made.columns for path in self.paths[k]):
            return None
        by_value = np.sum([made.columns[path] for path in self.paths[k]], axis=0)
        return np.asarray(by_value * self._problem.unknowns[k].slope(float(z[k])))

    def _drop(self, k: int, why: str) -> None:
        """Take differences for an unknown from now on."""
        del self.paths[k]
        self.sources[k] = f"differences: {why}"

    def _take_cheaper(self, made: dict[int, Slopes]) -> None:
        """Take differences where sensitivities take more evaluations."""
        work = {k: sum(made[k].along.values()) for k in self.paths}
        plain = {k: made[k].evaluations for k in self.paths}
        for k in list(self.paths):
            if work[k] > _RUNS * plain[k]:
                times = work[k] / (_RUNS * max(plain[k], 1))
                self._drop(k, f"sensitivities take {times:.2g} times their evaluations")
        # all sensitivities come from one run more
        kept = list(self.paths)
        if kept and sum(work[k] for k in kept) + plain[kept[0]] > _RUNS * plain[kept[0]] * len(
            kept
        ):
            for k in kept:
                self._drop(k, "sensitivities and the run that they are of take more evaluations")

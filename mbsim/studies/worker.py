"""What a worker does: run a study's runs, one after the other, each becoming a row."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from mbsim.errors import Interrupted, MbsimError, ResultsError, UnknownSignal
from mbsim.studies.outputs import Absent

if TYPE_CHECKING:
    from pathlib import Path

    from mbsim.results.reading import Results
    from mbsim.studies.study import Case, Study

#: A run ended as asked; it did, and warned of something; it did not.
FINISHED, WARNED, FAILED = "finished", "warned", "failed"

#: Users' code and the compiler have one state a process: runs take turns.
_ALONE = threading.Lock()


class PoolLost(ResultsError):
    """Who runs a study cannot be reached any more: what is not done yet will not be."""


class Row(NamedTuple):
    """What a run left: `outputs` holds a number, a list of a curve, or None, by name."""

    run: int
    status: str
    reason: str
    outputs: dict[str, Any]
    steps: int
    evaluations: int
    lost: bool = False  # whether its worker was, which says nothing of the run
    slopes: dict[str, Any] | None = None  # of curves, see `_slopes`


def failed(run: int, reason: str, lost: bool = False) -> Row:
    """Return the row of a run that left nothing but why."""
    return Row(run, FAILED, reason, {}, 0, 0, lost)


def run_one(study: Study, case: Case, folder: Path | None = None) -> Row:
    """Return the row of a run; what went wrong is its `reason`.

    Parameters
    ----------
    study : Study
    case : Case
    folder : Path, optional
        Where all its results are written; else they are dropped.

    Raises
    ------
    Interrupted
        If a signal ended it.
    """
    from mbsim.reader.xml import read_model
    from mbsim.run.options import Options
    from mbsim.run.simulation import run_model

    said: list[str] = []
    try:
        model = read_model(study.model, study.overrides(case.values))
        kept = () if folder is not None else study.signals
        options = Options(
            **study.options,
            output=folder,
            signals=kept,
            notify=said.append,
            bare=folder is None,
            sensitivity=case.sensitivity,
            sensitivity_worth=case.worth,
        )
        results = run_model(model, options)
    except Interrupted:
        raise
    except Exception as error:  # a fault of users' code, or of ours, is for the table too
        return failed(case.run, f"{type(error).__name__}: {error}")
    with results:
        warnings = [line for line in said if _warns(line)]
        row = _row(study, case, results, [*model.warnings, *warnings])
        if case.sensitivity and row.status != FAILED:
            row = row._replace(slopes=_slopes(study, case, results))
        return row


def _slopes(study: Study, case: Case, results: Results) -> dict[str, Any]:
    """Return derivatives of curves: attribute -> what is known of it, and lists by output."""
    found: dict[str, Any] = {}
    for path in case.sensitivity:
        about, curves = results.parameters[path], {}
        why = str(about["why"])
        for output in study.outputs:
            if output.is_curve and output.signal not in (None, "time"):
                try:
                    slope = results.sensitivity(str(output.signal), path)
                except UnknownSignal as error:
                    why = str(error)
                else:
                    curves[output.name] = np.asarray(slope, dtype=np.float64).tolist()
        found[path] = {"evaluations": int(about["evaluations"]), "why": why, "curves": curves}
    return found


def _warns(line: str) -> bool:
    """Return whether a line for the user is a warning."""
    return line.startswith("warning: ") or ": warning: " in line


def _row(study: Study, case: Case, results: Results, warnings: list[str]) -> Row:
    """Return what a study keeps of results."""
    values: dict[str, Any] = {}
    scalars = dict(case.values)
    for output in study.outputs:
        try:
            value = output.of(results, scalars)
        except Absent as error:
            value = None
            warnings.append(str(error))
        except MbsimError as error:
            return failed(case.run, f"{type(error).__name__}: {error}")
        if value is not None and not np.all(np.isfinite(value)):
            warnings.append(f"outputs.{output.name}: is not finite")
        values[output.name] = value
        if not output.is_curve:
            scalars[output.name] = float("nan") if value is None else value
    stats = results.stats
    status = WARNED if warnings else FINISHED
    reason = "; ".join(dict.fromkeys(warnings))
    return Row(case.run, status, reason, values, int(stats["steps"]), int(stats["rhs_evaluations"]))


class Pool(Protocol):
    """Who runs cases of a study: processes of this machine, a cluster, or this process."""

    def share(self, cases: Iterable[Case], count: int) -> Iterator[Row]:
        """Yield the row of each of `count` runs as it comes."""

    def close(self) -> None:
        """Let go of what runs them."""


class Here:
    """A pool that is the process itself."""

    def __init__(self, study: Study) -> None:
        self._study = study

    def share(self, cases: Iterable[Case], count: int) -> Iterator[Row]:
        """Yield the row of each run in turn."""
        return (run_one(self._study, case) for case in cases)

    def close(self) -> None:
        """Do nothing: there is nothing to let go of."""


def run_batch(study: Study, cases: list[Case]) -> list[Row]:
    """Return the rows of several runs: a task of a cluster."""
    with _ALONE:
        return [run_one(study, case) for case in cases]

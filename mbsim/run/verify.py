"""`mbsim run --verify`: error bars of a finished run, by runs with another method or step.

A rerun shares with the run what all methods share: the model, its meshes, what a law says. What
it does not share is the error of integration: it is run at a tenth of the tolerance, by a method
of another kind where the run stayed explicit, and with steps of at most T/97.3, which find pulses
that longer steps pass over.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.compile_model.tangent import MOST_BODIES as MOST_LINEARISED
from mbsim.errors import Interrupted, MbsimError, SolverError
from mbsim.integrators.catalog import AUTO, IMPLICIT
from mbsim.results import error_bars
from mbsim.results.error_bar_file import kept, over_time
from mbsim.run.options import Options, TooMuchWork

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.error_bars import Bars
    from mbsim.results.reading import Results

Run = Callable[["Model", Options], "Results"]

#: Of a rerun: its tolerance over that of the run, and steps that it has at least.
TIGHTER, STEPS = 0.1, 97.3
#: Evaluations of a rerun over those of the run, from which on it is not worth it.
MOST_WORK, LEAST_WORK = 5.0, 20000
_EXPLICIT = ("DOPRI5", AUTO)
FULL = "full"
#: An energy balance that is off by so many of its bars has another cause than integration.
BLIND = 10.0


class Reruns:
    """Reruns of one run, and how far it is off them."""

    def __init__(self, model: Model, options: Options, results: Results, run: Run) -> None:
        self.model, self.run = model, run
        self.tell = options.notify or (lambda line: None)
        self.options = replace(
            options,
            output=None,
            resume=False,
            dump_fclib=None,
            dump_hardest=None,
            verify=False,
            notify=None,
            sensitivity=(),
        )
        self.held = over_time(results)
        self.events, self.peaks = results["events"], _peaks(results)
        self.stats, self.integrator = results.stats, str(results.attributes["integrator"])
        about = results.attributes
        self.step_error = float(about["tol"]) * float(about["length"])
        self.apart: list[dict[str, Any]] = []
        self.others: list[Any] = []
        self.off_peaks: dict[str, Any] = {}
        self.lines: list[str] = []
        self.until = -math.inf

    @property
    def _stayed_explicit(self) -> bool:
        return self.integrator in _EXPLICIT and not self.stats["implicit_evaluations"]

    def all(self, full: bool) -> None:
        """Run again as often as is asked for."""
        other = self.integrator
        if self._stayed_explicit:
            other = "DOP853"
        elif other == "DOP853" and len(self.model.bodies) <= MOST_LINEARISED:
            other = IMPLICIT
        most = int(max(MOST_WORK * self.stats["rhs_evaluations"], LEAST_WORK))
        fixed = self.integrator == "VERLET"
        # its error is that of its step, which tol does not govern
        capped = {"h_most": 0.5 * self.stats["h_largest"]} if fixed else {"least_steps": STEPS}
        whole = self._once(other, most_evaluations=None if fixed else most, **capped)
        if not whole and not fixed:
            self.lines.append(f"{other} took more than {MOST_WORK:g} times the work: left out")
        if (full or not whole) and not fixed:
            self._once(self.integrator)
        if full and any(c.cff_type == "STICTION" for c in self.model.contacts.values()):
            self._once(IMPLICIT)
        if self.apart and not any(self._differs(apart) for apart in self.apart):
            # both took the same steps: tol does not govern here
            self._once(self.integrator, h_most=0.5 * self.stats["h_largest"])

    def _differs(self, apart: dict[str, Any]) -> bool:
        """Whether any signal of a rerun is another than the run's."""
        return any(np.nan_to_num(table).any() for table in apart.values())

    def _once(self, integrator: str, **changed: Any) -> bool:
        """Run once more and keep how far it is off; return False where it took too much work."""
        given = replace(self.options, integrator=integrator, tighter=TIGHTER, **changed)
        self.tell(f"verifying by {integrator}, tol {TIGHTER:g} times the run's")
        try:
            results = self.run(self.model, given)
        except TooMuchWork:
            return False
        except Interrupted:
            raise
        except MbsimError as error:
            self.lines.append(f"a rerun by {integrator} ended early: {error}")
            return True
        with results:
            if results.stats["rhs_evaluations"] > (given.most_evaluations or math.inf):
                return False  # compiled code may have come back too late to say so
            rerun = over_time(results)
            self.apart.append(error_bars.apart_from(self.held, rerun))
            self.others.append(results["events"])
            self.until = max(self.until, float(rerun["time"][-1]))
            for name, value in _peaks(results).items():
                off = error_bars.FACTOR_ONCE * np.abs(self.peaks[name] - value)
                self.off_peaks[name] = np.maximum(self.off_peaks.get(name, 0.0), off)
        return True

    def bars(self) -> Bars:
        """Return the bars that the reruns give."""
        tables = self.held, self.apart, self.events, self.others, self.off_peaks
        return error_bars.make(*tables, self.lines, self.step_error)


def _peaks(results: Results) -> dict[str, Any]:
    """Return the largest values over all steps, by dataset."""
    if not results.ids("contacts"):
        return {}
    found = results.tables("contacts")
    return {f"contacts/{name}": table for name, table in found.items() if name[:5] == "peak_"}


def verified(model: Model, options: Options, results: Results, run: Run) -> Results:
    """Return the results with error bars, which reruns of `run` give.

    Raises
    ------
    ModelError
        If no rerun came to a row of the run.
    Interrupted
        What the run recorded is kept, without bars.
    """
    reruns = Reruns(model, options, results, run)
    try:
        reruns.all(options.verify == FULL)
    except Interrupted as error:
        results.close()
        what = f"{error}, in a rerun of --verify: results are complete, without error bars"
        raise Interrupted(what, error.exit_code - 128) from None
    if not reruns.apart:
        results.close()
        why = "; ".join(reruns.lines)
        raise SolverError(f"--verify: no rerun came to its end: {why}; results are complete")
    bars = reruns.bars()
    audit = results.audit
    if audit is not None and audit.balance > BLIND * bars.energy:
        bars.lines.append(
            f"warning: the energy balance is off by {audit.balance:.2g} {audit.unit}, {BLIND:g} "
            "times its error bar or more: the model itself loses or gains it, whatever tol"
        )
    for line in bars.lines:
        reruns.tell(line)
    return kept(results, bars)

"""Work of the methods on the stiff decks at equal error, against explicit DOPRI5.

python -m pytest -m bench -s tests/bench/test_stiff.py
python -m pytest -m bench -s tests/bench/test_stiff.py -k "rolling_sphere or summary"

For every deck, method and tol: error, law calls (normal and friction), evaluations, Jacobians,
time. A Jacobian counts as one evaluation beside those that it took. At errors that both reached,
between measured points of each method's front (log-log), the table says how many times the work
of the method DOPRI5 needs, by evaluations and by law calls.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS, USERFUNCS
from mbsim.bench import ours, stiff
from mbsim.bench.front import Point, front, time_at
from mbsim.errors import ModelError, SolverError

pytestmark = pytest.mark.bench

EXPLICIT = "DOPRI5"
COMPARED = (EXPLICIT, "GALPHA", "RADAU5", "AUTO")
TOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Errors at which methods are compared, in parts of a deck's size.
ERRORS = tuple(10.0**-k for k in range(1, 10))
#: A run that takes longer than this [s] is the last of its method on a deck.
PATIENCE = 30.0
#: Rows of the summary, as the decks are run.
summary: dict[str, dict[str, list[Run]]] = {}


class Run(NamedTuple):
    method: str
    tol: float
    error: float
    law_calls: int
    evaluations: int
    jacobians: int
    steps: int
    rejected: int
    wall: float

    @property
    def work(self):
        return {"evaluations": self.evaluations + self.jacobians, "law calls": self.law_calls}

    def show(self):
        print(
            f"  {self.method:7} {self.tol:5.0e}  error {self.error:8.1e}  "
            f"law calls {self.law_calls:9}  evaluations {self.evaluations:9}  "
            f"Jacobians {self.jacobians:6}  steps {self.steps:8}  rejected {self.rejected:6}  "
            f"{self.wall:7.3f} s",
            flush=True,
        )


def run(deck, model, method, tol):
    results = mbsim.simulate(model, integrator=method, tol=tol)
    s = results.stats
    return Run(
        method,
        tol,
        stiff.error(deck, ours.outcome(results, 0.0)),
        int(s["normal_calls"] + s["friction_calls"]),
        int(s["rhs_evaluations"]),
        int(s["jacobians"]),
        int(s["steps"]),
        int(s["rejected"]),
        float(s["loop_s"]),
    )


def ladder(deck, model, method):
    """Yield runs of a method, looser ones first."""
    for tol in TOLS:
        found = run(deck, model, method, tol)
        yield found
        if found.wall > PATIENCE:
            print(f"  {method}: tighter ones left out, this one took {found.wall:.0f} s")
            return


def work_front(runs, kind):
    """Return the front of work against error."""
    points = [Point(max(r.error, 1e-16), r.work[kind], r.method, f"{r.tol:g}") for r in runs]
    return front(p for p in points if math.isfinite(p.error))


def ratios(runs, explicit, kind):
    """Return {error: explicit work over the method's} where both reached the error."""
    mine, theirs = work_front(runs, kind), work_front(explicit, kind)
    both = {error: (time_at(mine, error), time_at(theirs, error)) for error in ERRORS}
    return {e: t / m for e, (m, t) in both.items() if m and t}


def spread(found):
    """Return the smallest and the largest ratio with the errors where they are, as text."""
    if not found:
        return "no common error"
    low, high = min(found, key=found.get), max(found, key=found.get)
    return f"{found[low]:.3g} (at {low:.0e}) to {found[high]:.3g} (at {high:.0e})"


def show_ratios(runs_of):
    for method in COMPARED[1:]:
        for kind in ("evaluations", "law calls"):
            found = ratios(runs_of[method], runs_of[EXPLICIT], kind)
            if any(r.work[kind] for r in runs_of[method]):
                text = "  ".join(f"{e:.0e}: {ratio:.3g}" for e, ratio in found.items())
                print(f"  {kind} of {EXPLICIT} / {method}: {text or 'no common error'}")


@pytest.mark.parametrize("deck", stiff.DECKS, ids=lambda deck: deck.name)
def test_every_method_runs_every_stiff_deck(deck):
    print(f"\n{deck.name}: {deck.title}")
    model = mbsim.read_model(stiff.deck_path(deck))
    runs_of = summary[deck.name] = {}
    for method in COMPARED:
        # compiled or loaded before anything is timed
        mbsim.simulate(model, integrator=method, end_time=deck.sample, print_interval=deck.sample)
        for found in ladder(deck, model, method):
            found.show()
            runs_of.setdefault(method, []).append(found)
    show_ratios(runs_of)
    assert all(np.isfinite(r.error) for runs in runs_of.values() for r in runs)


def every_deck():
    """Yield name, model and settings of every compliant deck of `models/`, the stiff ones too."""
    for path in sorted([*MODELS.glob("*.xml"), *(MODELS / "stiff").glob("*.xml")]):
        plugins = [USERFUNCS / "seed_cffsub.py"] if path.stem == "seed_contact" else []
        yield path.relative_to(MODELS).with_suffix(""), mbsim.read_model(path), plugins


def timed(model, method, tol, plugins):
    """Return the positions of a run, and the time of its loop, the best of three; None, inf: none.

    One of more than 1 s runs once.
    """
    best, found = math.inf, None
    for _ in range(4):
        try:
            done = mbsim.simulate(model, integrator=method, tol=tol, plugins=plugins)
        except (SolverError, ModelError):
            return None, math.inf
        found = [done[f"bodies/{b}/position"] for b in done.ids("bodies")]
        seconds = float(done.stats["loop_s"])
        best = min(best, seconds)
        if seconds > 1.0:
            break
    return np.array(found), best


def distance(one, other):
    """Return the root mean square of the distance of bodies over rows, over how far they go."""
    size = np.ptp(other, axis=1).max() or 1.0
    return float(np.sqrt(np.mean((one - other) ** 2)) / size)


def test_auto_against_the_better_of_explicit_and_stiff():
    """Time of the loop at the error that AUTO has at default settings.

    Errors are against the tightest run of RADAU5, known to how far that of DOPRI5 is from it. A
    run of some ms stays explicit: to load an implicit method takes longer than it could win.
    """
    fixed = [name for name in COMPARED if name != "AUTO"]
    within, all_of = 0, 0
    for name, model, plugins in every_deck():
        ends = [timed(model, method, 1e-10, plugins)[0] for method in ("RADAU5", EXPLICIT)]
        known = [end for end in ends if end is not None]
        sure = distance(*known) if len(known) == 2 else math.nan
        fronts = {}
        for method in fixed:
            points = []
            for tol in TOLS:
                found, seconds = timed(model, method, tol, plugins)
                if found is not None and known:
                    points.append(Point(distance(found, known[0]), seconds, method, f"{tol:g}"))
                if seconds > PATIENCE:
                    break
            fronts[method] = front(points)
        found, seconds = timed(model, "AUTO", 1e-5, plugins)
        assert found is not None
        error = distance(found, known[0]) if known else math.nan
        times = {method: time_at(points, error) for method, points in fronts.items()}
        reached = {method: time for method, time in times.items() if time}
        better = min(reached, key=reached.get) if reached else None
        ratio = seconds / reached[better] if better else 0.0
        within, all_of = within + (ratio <= 1.3), all_of + 1
        said = "  ".join(f"{m} {1e3 * time:.2f} ms" for m, time in reached.items())
        print(
            f"{name!s:30} AUTO / {better} {ratio:.2f}  error {error:.1e} (known to {sure:.1e})  "
            f"AUTO {1e3 * seconds:.2f} ms  {said}",
            flush=True,
        )
    print(f"within 1.3: {within} of {all_of}")
    assert all_of > 40


@pytest.mark.parametrize("method", COMPARED)
def test_no_failure_at_default_settings(method):
    for deck in stiff.DECKS:
        results = mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), integrator=method)
        assert results["time"][-1] == pytest.approx(deck.end_time), deck.name


def test_summary():
    """One line a deck and method, of the decks that were run before."""
    print()
    for deck in (deck for deck in stiff.DECKS if deck.name in summary):
        runs_of = summary[deck.name]
        for method in COMPARED[1:]:
            found = [
                ratios(runs_of[method], runs_of[EXPLICIT], kind)
                for kind in ("evaluations", "law calls")
            ]
            name = deck.name if deck.stiff else f"{deck.name} (not stiff)"
            by_calls = f", law calls {spread(found[1])}" if found[1] else ""
            print(f"{name:23} {method:7} evaluations {spread(found[0])}{by_calls}")
    assert set(summary) <= {deck.name for deck in stiff.DECKS}

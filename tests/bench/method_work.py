"""Work of every method on every deck: evaluations, error, AUTO against the better of its kinds.

python tests/bench/method_work.py run OUT.jsonl [DECK ...] [--tols 1e-3,1e-5] [--methods AUTO]
python tests/bench/method_work.py table OUT.jsonl

Without DECK the decks of `models/`, the stiff ones too; one may be a file anywhere. `run` goes on
where OUT.jsonl ends. `table` prints a line a deck and tol: evaluations of each method with its
Jacobians, the error of each, AUTO's work over that of the better of explicit and stiff at AUTO's
error, by count and by time; then where a looser tol took more work than the next tighter one, and
where a tighter one has more than twice the error, but for what `known` explains.
Work is evaluations and Jacobians, those of an implicit method as IMPLICIT_WORK each.

Errors are of positions, root mean square over bodies and rows in parts of the way they go, against
the tightest run of RADAU5 (--reference); `known` is how far that of DOPRI5 is from it. Seconds are
the loop's alone, of this process, the best of two: what is loaded and compiled is not in them.
With --load, what a process pays once for RADAU5, AUTO is judged by those as well that its process
takes: the loop's, and this where RADAU5 ran in it.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import mbsim
from mbsim.bench.front import Point, front, time_at
from mbsim.errors import MbsimError
from mbsim.integrators.changing import IMPLICIT_WORK
from mbsim.run import loop

ROOT = Path(__file__).parents[2]
PLUGINS = {"seed_contact": ["seed_cffsub.py"]}
EXPLICIT, STIFF = ("DOPRI5", "DOP853"), ("RADAU5",)
METHODS = ("AUTO", "RADAU5", "DOPRI5", "DOP853", "GALPHA")
TOLS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
REFERENCES = ("RADAU5", "DOPRI5")
#: A run ends after so many seconds [s] of its process; one that took as long as this runs once.
LIMIT, AGAIN = 8.0, 1.0
#: A looser tol may take so many times the work of the next tighter one; AUTO of the better.
SLOWER, BEHIND = 1.2, 1.3
#: A tighter tol may have so many times the error of the next looser one, above rounding.
RISES, ROUNDING = 2.0, 1e-12


class TooLongError(Exception):
    """A run took longer than it may."""


def once(path, method, tol, limit):
    """Return positions (bodies, rows, 3) and counters of a run, or None and why there is none."""
    began = []

    def progress(t, h, end):
        # the first call comes when all is compiled
        began.append(time.process_time())
        if began[-1] - began[0] > limit:
            raise TooLongError

    plugins = [ROOT / "userfuncs" / name for name in PLUGINS.get(path.stem, [])]
    try:
        with mbsim.simulate(
            mbsim.read_model(path), integrator=method, tol=tol, plugins=plugins, progress=progress
        ) as results:
            places = [results[f"bodies/{b}/position"] for b in results.ids("bodies")]
            return np.array(places), dict(results.stats)
    except TooLongError:
        return None, f"over {limit:g} s"
    except MbsimError as error:
        return None, str(error)[:80]


def measured(path, method, tol, limit):
    """Return positions and counters of a run, its seconds those of the faster of two."""
    places, stats = once(path, method, tol, limit)
    if places is not None and stats["loop_s"] < AGAIN:
        seconds = stats["loop_s"]
        places, stats = once(path, method, tol, limit)
        stats["loop_s"] = min(seconds, stats["loop_s"])
    return places, stats


def distance(one, other):
    """Return the root mean square of the distance of bodies over rows, over how far they go."""
    size = np.ptp(other, axis=1).max() or 1.0
    return float(np.sqrt(np.mean((one - other) ** 2)) / size)


def reference(path, folder, tol, limit):
    """Return the positions that runs are compared with, None for none, and how far it is known."""
    ends = []
    for method in REFERENCES:
        kept = folder / f"{name_of(path).replace('/', '_')}__{method}__{tol:g}.npy"
        if not kept.exists():
            places, _ = once(path, method, tol, limit)
            np.save(kept, np.zeros(0) if places is None else places)
        ends.append(np.load(kept))
    known = [end for end in ends if end.size]
    return (known[0] if known else None), (distance(*known) if len(known) == 2 else math.nan)


def run(options):
    """Run what OUT.jsonl does not have yet."""
    loop.time = SimpleNamespace(perf_counter=time.process_time)
    out, folder = Path(options.out), Path(f"{options.out}.d")
    folder.mkdir(exist_ok=True)
    done = {(r["deck"], r["method"], r["tol"]) for r in rows(out)}
    decks = [Path(deck) if deck.endswith(".xml") else named(deck) for deck in options.decks]
    folders = (ROOT / "models", ROOT / "models" / "stiff")
    for path in decks or sorted(each for folder in folders for each in folder.glob("*.xml")):
        exact, known = None, math.nan
        if not options.no_errors:
            exact, known = reference(path, folder, options.reference, 4.0 * options.limit)
        for method in options.methods.split(","):
            failed = 0
            for tol in map(float, options.tols.split(",")):
                if (name_of(path), method, tol) in done or failed == 2:
                    continue
                places, stats = measured(path, method, tol, options.limit)
                row = {"deck": name_of(path), "method": method, "tol": tol, "known": known}
                if places is None:
                    failed += 1
                    row["why"] = stats
                else:
                    row |= {k: v for k, v in stats.items() if isinstance(v, int | float)}
                    row["error"] = math.nan if exact is None else distance(places, exact)
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")


def named(deck):
    """Return the file of a deck of `models/`, as `sdnd100` or `stiff/lugre`."""
    return ROOT / "models" / f"{deck}.xml"


def name_of(path):
    """Return what `named` knows a deck by, of others its stem: two have the same stem."""
    inside = path.is_relative_to(ROOT / "models")
    return path.relative_to(ROOT / "models").with_suffix("").as_posix() if inside else path.stem


def rows(out):
    """Return what was run."""
    if not out.exists():
        return []
    return [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]


def evaluations(row):
    """Return the evaluations of a run, a Jacobian as one more."""
    return row["rhs_evaluations"] + row["jacobians"]


def work(row):
    """Return the work of a run in evaluations of an explicit method."""
    return evaluations(row) + (IMPLICIT_WORK - 1.0) * (
        row["implicit_evaluations"] + row["jacobians"]
    )


def ratio(row, others, cost):
    """Return AUTO's cost over that of the better of explicit and stiff at its error, and which."""
    reached = {}
    for method in EXPLICIT + STIFF:
        runs = [r for r in others if r["method"] == method]
        points = [Point(max(r["error"], 1e-16), cost(r), method, f"{r['tol']:g}") for r in runs]
        found = time_at(front(p for p in points if math.isfinite(p.error)), row["error"])
        if found:
            reached[method] = found
    if not reached:
        return math.nan, "-"
    better = min(reached, key=reached.get)
    return cost(row) / reached[better], better


def loads(row):
    """Return whether a run loads the implicit method."""
    return row["method"] in STIFF or row["method_changes"] > 0


def rise(loose, tight):
    """Return what is said where a tighter tol has a larger error than explained, else nothing."""
    least = ROUNDING if math.isnan(tight["known"]) else max(ROUNDING, tight["known"])
    if not tight["error"] > max(RISES * loose["error"], least):
        return []
    errors = f"{loose['error']:.1e} at {loose['tol']:.0e}, {tight['error']:.1e} at"
    return [f"{tight['deck']} {tight['method']}: {errors} {tight['tol']:.0e}"]


def table(options):
    """Print what was run."""
    found = rows(Path(options.out))
    decks = dict.fromkeys(r["deck"] for r in found)
    behind, compared, slower, paid, risen, decades = [], 0, [], [], [], 0
    for deck in decks:
        of = [r for r in found if r["deck"] == deck]
        good = [r for r in of if "why" not in r]
        print(deck)
        for r in of:
            if "why" in r:
                print(f"  {r['tol']:.0e} {r['method']}: {r['why']}")
        for tol in sorted({r["tol"] for r in good}, reverse=True):
            said = f"  {tol:.0e}"
            for r in (r for r in good if r["tol"] == tol):
                said += f"  {r['method']} {evaluations(r)} ({r['error']:.1e})"
                if r["method"] == "AUTO" and r["method_changes"]:
                    said += f" {r['method_changes']} changes"
            for r in (r for r in good if r["tol"] == tol and r["method"] == "AUTO"):
                whole = ratio(r, good, lambda r: r["loop_s"] + options.load * loads(r))[0]
                if options.load and whole > BEHIND:
                    paid.append(f"{deck} {tol:.0e} {whole:.2f}")
                (counted, by), (timed, at) = (
                    ratio(r, good, cost) for cost in (work, lambda r: r["loop_s"])
                )
                said += f"  AUTO / {by} {counted:.2f} by work, / {at} {timed:.2f} by time"
                said += f" of {1e3 * r['loop_s']:.1f} ms"
                if math.isfinite(counted):
                    compared += 1
                    if min(counted, timed) > BEHIND:
                        behind.append(f"{deck} {tol:.0e} {counted:.2f} {timed:.2f} {by}")
            print(said)
        for method in dict.fromkeys(r["method"] for r in good):
            runs = sorted((r for r in good if r["method"] == method), key=lambda r: -r["tol"])
            for loose, tight in itertools.pairwise(runs):
                decades, risen = decades + 1, risen + rise(loose, tight)
                times = work(loose) / work(tight)
                if times > SLOWER:
                    seconds = loose["loop_s"] / tight["loop_s"]
                    slower.append(
                        f"{deck} {method} {loose['tol']:.0e} takes {times:.2f} of "
                        f"{tight['tol']:.0e} ({evaluations(loose)} evaluations, "
                        f"{seconds:.2f} of the time)"
                    )
    print(f"\nAUTO over {BEHIND} of the better: {len(behind)} of {compared}", *behind, sep="\n  ")
    if options.load:
        said = f"\nAUTO over {BEHIND} of the better with what is loaded: {len(paid)} of {compared}"
        print(said, *paid, sep="\n  ")
    print(f"\nlooser and over {SLOWER} times the work: {len(slower)}", *slower, sep="\n  ")
    print(f"\nover {RISES} times the error: {len(risen)} of {decades}", *risen, sep="\n  ")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("run", "table"))
    parser.add_argument("out")
    parser.add_argument("decks", nargs="*")
    parser.add_argument("--tols", default=",".join(f"{tol:g}" for tol in TOLS))
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--limit", type=float, default=LIMIT)
    parser.add_argument("--reference", type=float, default=1e-10, help="tol of what is compared")
    parser.add_argument("--load", type=float, default=0.0, help="seconds to load RADAU5")
    parser.add_argument("--no-errors", action="store_true")
    given = parser.parse_args()
    (run if given.what == "run" else table)(given)

"""Counters of runs, held by tests/integration/test_counters.py; run this to write them down.

    python tests/counters.py            prints those that changed, and writes what got less
    python tests/counters.py --accept   writes those that got more as well: say why in the commit

A counter is a number of evaluations, factorisations, pairs, ...: the same on every machine and
under any load, as the decks are not chaotic. They were the same, each one, with
NUMBA_CPU_NAME=generic and OPENBLAS_CORETYPE=PRESCOTT; so is a new one to be tried.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import mbsim

TESTS = Path(__file__).resolve().parent
MODELS = TESTS.parent / "models"
FILE = TESTS / "data" / "counters.json"
COUNTERS = (
    "steps",
    "rejected",
    "rhs_evaluations",
    "output_evaluations",
    "jacobians",
    "factorizations",
    "narrowphase_pairs",
    "pair_listings",
    "fcl_calls",
    "normal_calls",
    "friction_calls",
    "python_calls",
)
#: What a counter may be off by; of small ones, whatever rounding decides: so many.
SHARE, FEW = 0.02, 3


def count(case):
    """Return the counters of a case: a deck of `models/`, and what it is run with."""
    deck, *settings = case.split()
    given = dict(setting.split("=") for setting in settings)
    with mbsim.simulate(mbsim.read_model(MODELS / f"{deck}.xml"), **given) as results:
        return {name: int(results.stats[name]) for name in COUNTERS}


def committed():
    """Return the counters that are written down, by case."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def changed(found, kept):
    """Yield name, count and what was written down, of counters that are off."""
    for name in COUNTERS:
        if abs(found[name] - kept[name]) > max(FEW, SHARE * kept[name]):
            yield name, found[name], kept[name]


def main():
    """Compare all cases, and write what got less."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--accept", action="store_true", help="write what got more as well")
    accept = parser.parse_args().accept
    table, more = committed(), False
    for case, kept in table.items():
        found = count(case)
        for name, now, before in changed(found, kept):
            print(f"{case}: {name} {before} -> {now}")
            if accept or now < before:
                kept[name] = now
            else:
                more = True
    FILE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    return int(more)


if __name__ == "__main__":
    sys.exit(main())

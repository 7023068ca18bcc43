"""What the audit takes of the loop: decks of `models/` with it, and with samples at the end alone.

python tests/bench/audit_cost.py [DECK ...]

Loops in turn, with and without, many times; the least of each counts. Samples where a contact
begins or ends are taken either way.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from unittest import mock

import mbsim
from mbsim.errors import MbsimError

MODELS = Path(__file__).parents[2] / "models"
EACH = ("EVERY", "EVERY_OF_MANY", "EVERY_IMPLICIT")
#: Loops shorter than this [s] are lost in what a clock does; of one kind, so many are run.
LEAST, ROUNDS = 2e-4, 15
#: A deck's loop of this length [s] is run three times.
LONG = 2.0


def loop_of(model):
    """Return the loop's time [s]."""
    return float(mbsim.simulate(model).stats["loop_s"])


def without(model):
    """Return the loop's time [s] where no sample is due until the end."""
    never = {name: 1e18 for name in EACH}
    with mock.patch.multiple("mbsim.run.methods", **never):
        return loop_of(model)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("decks", nargs="*", type=Path)
    decks = parser.parse_args().decks or sorted(MODELS.rglob("*.xml"))
    shares = []
    for deck in decks:
        try:
            model = mbsim.read_model(deck)
            first = loop_of(model)
        except MbsimError as error:
            print(f"{deck.stem:28s} left out: {str(error).splitlines()[0][:60]}")
            continue
        if first < LEAST:
            continue
        rounds = 3 if first > LONG else ROUNDS
        times = [(loop_of(model), without(model)) for _ in range(rounds)]
        whole, bare = (min(each) for each in zip(*times, strict=True))
        shares.append(whole / bare - 1.0)
        print(f"{deck.stem:28s} {1e3 * whole:9.2f} ms, audit {100 * shares[-1]:5.1f} %", flush=True)
    print(f"median {100 * statistics.median(shares):.1f} %, largest {100 * max(shares):.1f} %")


if __name__ == "__main__":
    main()

"""What a body costs before a run begins, in calls: as much in a large deck as in a small one."""

from __future__ import annotations

import sys

from helpers.decks import GRAVITY, write_deck
from helpers.pile_decks import LAW, block, pile
from mbsim import read_model
from mbsim.results.identity import of_elements


def calls(work):
    """Return how many functions are called."""
    count = 0

    def seen(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(seen)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def test_reading_and_telling_a_body_costs_the_same_in_decks_of_any_size(tmp_path):
    decks = [
        write_deck(tmp_path, GRAVITY + pile(block(n, 0.21), **LAW), name=f"{n}.xml")
        for n in (2, 4, 6)
    ]
    # imports, and what is made once
    of_elements(read_model(decks[0]), str(decks[0]))
    reading = [calls(lambda deck=deck: read_model(deck)) for deck in decks]
    models = [read_model(deck) for deck in decks]
    telling = [calls(lambda model=model: of_elements(model, model.file)) for model in models]
    for counted in (reading, telling):
        few, many = (counted[1] - counted[0]) / (64 - 8), (counted[2] - counted[1]) / (216 - 64)
        assert many < 1.1 * few
    # 460 and 224 are counted
    assert (reading[2] - reading[1]) / (216 - 64) < 920
    assert (telling[2] - telling[1]) / (216 - 64) < 450

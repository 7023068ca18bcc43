"""S11: the stiff decks of `models/stiff/`, each against the table beside it."""

from __future__ import annotations

from functools import partial

from mbsim.bench import stiff
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Variation

#: Beyond these an explicit method's time stays that of stability.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


def _deck(deck: stiff.StiffDeck, variation: Variation) -> str:
    return stiff.deck_path(deck).read_text(encoding="utf-8")


def _errors(deck: stiff.StiffDeck, outcome: Outcome, variant: str) -> dict[str, float]:
    return {"position_error": stiff.error(deck, outcome)}


def _scene(deck: stiff.StiffDeck) -> Scene:
    return Scene(
        name=f"S11_{deck.name}",
        title=deck.title,
        end_time=deck.end_time,
        measure="position_error",
        unit=f"largest error of a position over {deck.size:g} m",
        deck=partial(_deck, deck),
        errors=partial(_errors, deck),
        tolerances=TOLERANCES,
        sample=deck.sample,
        repeats=3,
    )


SCENES = tuple(_scene(deck) for deck in stiff.DECKS)

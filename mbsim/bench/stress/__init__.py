"""Decks at the ends of what a user may ask for: each ends right, or says why it does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from mbsim.errors import ModelError

if TYPE_CHECKING:
    from mbsim.bench.stress.case import Case


class Asked(NamedTuple):
    """Which cases: families, whatever the case of their names, methods and tolerances.

    What is empty means all: of tolerances the three that each deck has.
    """

    families: Sequence[str] = ()
    integrators: Sequence[str] = ()
    tolerances: Sequence[float] = ()


def chosen(asked: Asked) -> list[Case]:
    """Return the cases that were asked for.

    Raises
    ------
    ModelError
        If there is no such family.
    """
    from mbsim.bench.stress import contacts, mechanisms
    from mbsim.bench.stress.case import cases_of

    decks = [*contacts.decks(), *mechanisms.decks()]
    families = list(dict.fromkeys(deck.family for deck in decks))
    known = {family.lower() for family in families}
    for name in asked.families:
        if name.lower() not in known:
            raise ModelError(f"stress {name}: not known; there are {', '.join(families)}")
    wanted = {name.lower() for name in asked.families} or known
    decks = [deck for deck in decks if deck.family.lower() in wanted]
    if asked.tolerances:
        decks = [deck._replace(tols=asked.tolerances) for deck in decks]
    methods = set(asked.integrators)
    return [case for case in cases_of(decks) if not methods or case.integrator in methods]

"""The stiff decks of `models/stiff/`: what each is, and the table of positions that it is held to.

A deck's table lies beside it: `NAME.csv`, comments first, then a line a time with positions of
centres of mass, `2/x` being x of body 2. `tests/stiff_references.py` writes the tables.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbsim.bench.outcome import Outcome

#: In an installed package the decks lie beside this file, in a checkout where all decks are.
FOLDERS = (
    Path(__file__).parent / "models" / "stiff",
    Path(__file__).parents[2] / "models" / "stiff",
)


class StiffDeck(NamedTuple):
    """One deck.

    Attributes
    ----------
    name, title
        Of its files; one line for tables and pictures.
    end_time, sample
        Of its Simulate: where it ends, and the time between its rows [s].
    columns
        Positions that are compared, e.g. ``2/x``: body and axis.
    size
        Length [m] that errors are divided by: how far things move in this deck.
    stiff
        Whether stability bounds an explicit method's steps most of the time; the others show
        what a stiff method costs where none is needed.
    """

    name: str
    title: str
    end_time: float
    sample: float
    columns: tuple[str, ...]
    size: float
    stiff: bool = True


DECKS = (
    StiffDeck("rebound", "ball of k = 1e9 hops and comes to rest", 2.0, 0.02, ("2/z",), 0.1),
    StiffDeck(
        "standing_cylinder", "cylinder lands on k = 1e9 and stands", 2.0, 0.02, ("2/z",), 1e-3
    ),
    StiffDeck(
        "box_stack",
        "three boxes creep on a slope, vs = 1e-5",
        0.2,
        0.01,
        ("2/x", "3/x", "4/x"),
        1e-6,
    ),
    StiffDeck(
        "rolling_sphere", "sphere rolls down, k = 1e7, vs = 1e-5 (Drake)", 1.0, 0.02, ("2/x",), 0.9
    ),
    StiffDeck(
        "four_bar_stop",
        "four-bar on a stop of k = 1e9, vs = 1e-5",
        0.6,
        0.01,
        ("2/x", "2/z", "3/x", "3/z", "4/x", "4/z"),
        0.1,
    ),
    StiffDeck(
        "stiff_governor",
        "flyball governor, dampers of 6.7e5 1/s",
        1.0,
        0.01,
        ("3/z", "4/x", "4/y", "4/z", "5/x", "5/y", "5/z"),
        1.0,
    ),
    StiffDeck("lugre", "stick and slip by a bristle state, s0 = 1e5", 20.0, 0.1, ("2/x",), 1.0),
    StiffDeck("jammed_wedge", "wedge jammed by friction, vs = 1e-4", 0.1, 0.005, ("2/z",), 6e-6),
    StiffDeck(
        "bushing_chain",
        "five rods in bushings of 1e9 N/m",
        0.5,
        0.01,
        tuple(f"{body}/{axis}" for body in range(2, 7) for axis in "xz"),
        1.0,
    ),
    StiffDeck(
        "overdamped", "mass creeps on a damper, rates 1e6 and 1 1/s", 1.0, 0.02, ("2/x",), 0.1
    ),
    StiffDeck("incline_creep", "block creeps for long, vs = 1e-5", 2.0, 0.05, ("2/x", "2/z"), 1e-5),
    StiffDeck(
        "preloaded_stop", "mass pressed against k = 1e10 and shaken", 1.0, 0.01, ("2/x",), 5e-7
    ),
    StiffDeck(
        "torsion_top",
        "heavy top on a torsional spring of 1e5 rad/s",
        1.0,
        0.02,
        tuple(f"{body}/{axis}" for body in (2, 3) for axis in "xyz"),
        1.0,
    ),
    StiffDeck(
        "squeezer",
        "Andrews' squeezer, not stiff",
        0.03,
        0.001,
        tuple(f"{body}/{axis}" for body in range(2, 9) for axis in "xy"),
        0.1,
        stiff=False,
    ),
)


def folder() -> Path:
    """Return where the decks are."""
    return next((each for each in FOLDERS if each.is_dir()), FOLDERS[0])


def deck_path(deck: StiffDeck) -> Path:
    """Return the file of a deck."""
    return folder() / f"{deck.name}.xml"


def table_path(deck: StiffDeck) -> Path:
    """Return the file of a deck's reference."""
    return folder() / f"{deck.name}.csv"


def table(deck: StiffDeck) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) [s] and reference positions (n, columns) [m] of a deck."""
    data = np.loadtxt(table_path(deck), delimiter=",", ndmin=2, skiprows=_comments(deck) + 1)
    return data[:, 0], data[:, 1:]


def _comments(deck: StiffDeck) -> int:
    """Return how many lines of a deck's table are comments."""
    lines = table_path(deck).read_text(encoding="utf-8").splitlines()
    return sum(line.startswith("#") for line in lines)


def positions(deck: StiffDeck, outcome: Outcome) -> np.ndarray:
    """Return the positions (n, columns) [m] that are compared; bodies are numbered from 2."""
    places = [(int(body) - 2, "xyz".index(axis)) for body, axis in _split(deck)]
    return np.stack([outcome.position[:, body, axis] for body, axis in places], axis=1)


def _split(deck: StiffDeck) -> list[list[str]]:
    """Return body and axis of each column."""
    return [column.split("/") for column in deck.columns]


def error(deck: StiffDeck, outcome: Outcome) -> float:
    """Return the largest error of a position over the rows, in parts of the deck's size."""
    times, exact = table(deck)
    rows = np.searchsorted(outcome.time, times - 1e-9 * times[-1])
    if not np.allclose(outcome.time[rows], times, rtol=1e-9, atol=1e-12):
        raise ValueError(f"{deck.name}: rows are not at the times of {table_path(deck).name}")
    return float(np.abs(positions(deck, outcome)[rows] - exact).max()) / deck.size

"""Writes the tables that the decks of `models/stiff/` are held to.

python tests/stiff_references.py [NAME]...

Closed forms and touch-to-touch solutions where there are such; else explicit DOP853 at tol 1e-11,
whose table says how far it is from that at 1e-10. `test_stiff_decks.py` has what else is known.
"""

from __future__ import annotations

import sys

import numpy as np

import mbsim
from helpers.reference import drop_height
from mbsim.bench import stiff
from mbsim.bench.ours import outcome

TOL = 1e-11


def landed(times, settled, z0, low, mass, stiffness, *law, g=9.81):
    """Return the height of a dropped body that rests, its damper whole, from `settled` on."""
    height = np.full(len(times), low - mass * g / stiffness)
    early = times <= settled
    height[early] = drop_height(times[early], z0, low, mass, stiffness, *law)
    return height


def rebound(times):
    return landed(times, 0.46, 0.2, 0.1, 1.0, 1e9, 1.0, 1.5e4, 5e-9)


def standing_cylinder(times):
    # three points of the same depth are one of three times the law
    return landed(times, 0.1, 0.101, 0.1, 2.0, 3e9, 1.0, 6e4, 2e-9)


def overdamped(times):
    """The slow root by k / fast, for it is what cancels in the formula."""
    fast = -0.5e6 - np.sqrt(0.25e12 - 1e6)
    slow = 1e6 / fast
    return 1.0 + 0.1 * (fast * np.exp(slow * times) - slow * np.exp(fast * times)) / (fast - slow)


def preloaded_stop(times):
    """Mean, harmonic and decaying part; the depth is x itself, the sphere touching at x = 0."""
    spun, stiffness, damping = 1j * 10.0 * np.pi, 1e10 + 1e4, 2e4
    mean = 5000.0 / stiffness
    wave = 3000.0 / (stiffness + spun * damping + spun**2)  # sine: imaginary part
    roots = np.roots([1.0, damping, stiffness]).astype(complex)
    rest = np.array([5e-7 - mean - wave.imag, -(spun * wave).imag])
    parts = np.linalg.solve(np.vstack([np.ones(2), roots]), rest)
    decay = sum(part * np.exp(root * times) for part, root in zip(parts, roots, strict=True))
    return mean + (wave * np.exp(spun * times)).imag + decay.real


CLOSED = {
    "rebound": rebound,
    "standing_cylinder": standing_cylinder,
    "overdamped": overdamped,
    "preloaded_stop": preloaded_stop,
}


def run(deck, **settings):
    """Return times and compared positions of a run of a deck."""
    found = outcome(mbsim.simulate(mbsim.read_model(stiff.deck_path(deck)), **settings), 0.0)
    return found.time, stiff.positions(deck, found)


def named(name):
    return next(deck for deck in stiff.DECKS if deck.name == name)


def planned_times(deck):
    """Return the times of a deck's rows."""
    simulation = mbsim.read_model(stiff.deck_path(deck)).simulations[0]
    rows = round(simulation.end_time / simulation.print_interval)
    return np.linspace(0.0, simulation.end_time, rows + 1)


def reference(deck):
    """Return times, positions, and what the table says of itself."""
    if deck.name in CLOSED:
        times = planned_times(deck)
        return times, CLOSED[deck.name](times)[:, None], "no code of the simulator"
    times, exact = run(deck, integrator="DOP853", tol=TOL)
    loose = run(deck, integrator="DOP853", tol=10 * TOL)[1]
    apart = np.abs(loose - exact).max() / deck.size
    off = f"at {10 * TOL:g} it is {apart:.1e} of {deck.size:g} m off"
    return times, exact, f"DOP853 at tol {TOL:g}; {off}"


def write(deck):
    times, exact, note = reference(deck)
    lines = [
        f"# positions [m] of centres of mass: {note}",
        f"# python tests/stiff_references.py {deck.name}",
        ",".join(["time", *deck.columns]),
        *(",".join(map(repr, map(float, (t, *row)))) for t, row in zip(times, exact, strict=True)),
    ]
    stiff.table_path(deck).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(deck.name, note, flush=True)


if __name__ == "__main__":
    for name in sys.argv[1:] or [deck.name for deck in stiff.DECKS]:
        write(named(name))

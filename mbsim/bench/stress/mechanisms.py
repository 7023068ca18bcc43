"""Joints and springs: over-constrained, folded, without length, fast, of unlike masses."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench.stress.case import COMPLIANT, EXPLICIT, Deck, Measures, Motion

#: Axes of a marker whose z is the global y: a joint turns about it.
ABOUT_Y = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))


def keeps_energy(motion: Motion, tol: float) -> Measures:
    """Compare the energy with that of the start."""
    off = np.abs(motion.energy - motion.energy[0]).max() / motion.size
    return {"energy": (float(off), min(0.02, 3.0 * motion.errors(tol)))}


def spring(number: int, i: int, j: int, k: float, length: float) -> str:
    """Return an undamped spring between two markers."""
    facts = text.attributes(
        id=number, type="TRANSLATIONAL", i_marker_id=i, j_marker_id=j,
        stiffness=float(k), damping=0.0, length=float(length),
    )  # fmt: skip
    return f"<Force_SpringDamper {facts}/>"


def springs() -> Iterator[Deck]:
    """Yield a mass on a spring of length 0, which goes round its end, near it, and through it."""
    for k in (1e2, 1e5, 1e8):
        for across in (1.0, 1e-3, 0.0):
            rate = math.sqrt(k)
            start, speed = np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.1 * rate * across, 0.0])

            def harmonic(
                motion: Motion, tol: float, start: np.ndarray = start, speed: np.ndarray = speed,
                rate: float = rate,
            ) -> Measures:  # fmt: skip
                turn = (rate * motion.time)[:, None]
                exact = start * np.cos(turn) + speed / rate * np.sin(turn)
                off = np.linalg.norm(motion.x[:, 0] - exact, axis=-1).max() / 0.1
                return {"place": (float(off), motion.errors(tol))}

            statements = [
                text.GROUND,
                text.marker(10, 1, (0.0, 0.0, 0.0)),
                text.body(2, 1.0, (1.0, 1.0, 1.0), tuple(start), tuple(speed)),
                spring(1, 20, 10, k, 0.0),
            ]
            deck = text.deck("A mass on a spring of length 0", statements, 13.0 / rate, 0.5 / rate)
            yield Deck(
                "zero length", f"k={k:g} across {across:g}", deck, COMPLIANT, harmonic,
                stored=0.5 * k * 0.01,
            )  # fmt: skip


def pendulums() -> Iterator[Deck]:
    """Yield double pendulums whose bobs are as unlike as they may be."""
    for ratio in (1e-6, 1e-3, 1e3, 1e6):
        statements = [
            text.GROUND,
            text.marker(10, 1, (0.0, 0.0, 0.0), ABOUT_Y),
            text.body(2, 1.0, (1e-2, 1e-2, 1e-2), (0.5, 0.0, 0.0)),
            text.marker(21, 2, (0.0, 0.0, 0.0), ABOUT_Y),
            text.marker(22, 2, (1.0, 0.0, 0.0), ABOUT_Y),
            text.body(3, ratio, (1e-2 * ratio,) * 3, (1.5, 0.0, 0.0)),
            text.marker(31, 3, (1.0, 0.0, 0.0), ABOUT_Y),
            text.joint(1, "REVOLUTE", 21, 10),
            text.joint(2, "REVOLUTE", 31, 22),
            text.gravity(),
        ]
        deck = text.deck("A double pendulum", statements, 1.0, 0.05)
        yield Deck("mass ratio", f"pendulum {ratio:g}", deck, COMPLIANT, keeps_energy)


def spinning() -> Iterator[Deck]:
    """Yield bodies that turn freely at 1e4 rad/s about no axis of theirs."""

    def turns(motion: Motion, tol: float) -> Measures:
        inertia = np.array([1.0, 2.0, 2.5])
        body = np.einsum("nba,nb->na", motion.R[:, 0], motion.w[:, 0])
        momentum = np.einsum("nab,nb->na", motion.R[:, 0], inertia * body)
        size = np.linalg.norm(momentum[0])
        off = np.linalg.norm(momentum - momentum[0], axis=-1).max() / size
        return {"angular momentum": (float(off), min(0.02, motion.errors(tol)))}

    for spin in ((1e4, 1.0, 0.0), (1.0, 1e4, 1.0), (6e3, 5e3, 6e3)):
        statements = [text.GROUND, text.body(2, 1.0, (1.0, 2.0, 2.5), spin=spin)]
        deck = text.deck("A body turns freely", statements, 0.05, 0.0025)
        name = " ".join(f"{x:g}" for x in spin)
        yield Deck("spin", f"free {name}", deck, COMPLIANT, turns)


def overconstrained() -> Iterator[Deck]:
    """Yield a door on several hinges, and a table on parallel cranks."""

    def swings(motion: Motion, tol: float) -> Measures:
        # hinges along y keep the door's middle in its plane
        off = np.abs(motion.x[:, 0, 1]).max()
        return keeps_energy(motion, tol) | {"out of plane": (float(off), max(1e-9, tol))}

    for count in (2, 3, 8):
        statements = [text.GROUND, text.body(2, 5.0, (0.2, 0.6, 0.8), (0.5, 0.0, 0.0))]
        for k in range(count):
            place = (0.0, -0.5 + k / (count - 1), 0.0)
            statements.append(text.marker(100 + k, 1, place, ABOUT_Y))
            statements.append(text.marker(200 + k, 2, place, ABOUT_Y))
            statements.append(text.joint(1 + k, "REVOLUTE", 200 + k, 100 + k))
        statements.append(text.gravity())
        deck = text.deck("A door on hinges", statements, 1.0, 0.05)
        yield Deck("over-constrained", f"door, {count} hinges", deck, COMPLIANT, swings)


def linkage(
    lengths: tuple[float, float, float, float], angles: tuple[float, float, float], rate: float
) -> str:
    """Return a four-bar: crank, coupler, rocker from their angles; the crank turns at `rate`."""
    ground, crank, _, rocker = lengths
    a = np.zeros(3)
    b = a + crank * np.array([math.cos(angles[0]), 0.0, math.sin(angles[0])])
    d = np.array([ground, 0.0, 0.0])
    c = d + rocker * np.array([math.cos(angles[2]), 0.0, math.sin(angles[2])])
    # velocities of a linkage that turns as a parallelogram does
    spin = (0.0, -rate, 0.0)
    swept = np.cross(spin, b - a)
    statements = [text.GROUND]
    for number, (p, q, v, w) in enumerate(
        ((a, b, 0.5 * swept, spin), (b, c, swept, (0.0,) * 3), (d, c, 0.5 * swept, spin)), 2
    ):
        inertia = float(np.dot(q - p, q - p)) / 12.0
        statements.append(text.body(number, 1.0, (inertia,) * 3, tuple(0.5 * (p + q)), tuple(v), w))
    for number, (place, i, j) in enumerate(((a, 2, 1), (b, 3, 2), (c, 4, 3), (d, 4, 1)), 1):
        statements.append(text.marker(100 + number, i, tuple(place), ABOUT_Y))
        statements.append(text.marker(200 + number, j, tuple(place), ABOUT_Y))
        statements.append(text.joint(number, "REVOLUTE", 100 + number, 200 + number))
    return text.deck("A linkage that folds", statements, 4.0 / rate, 0.2 / rate)


def folding() -> Iterator[Deck]:
    """Yield parallelograms that go through their flat position, where they may fold over."""

    def closes(motion: Motion, tol: float) -> Measures:
        # the coupler's ends are those of crank and rocker; rods are as long as they were
        def ends(body: int) -> tuple[np.ndarray, np.ndarray]:
            half = motion.R[:, body] @ (motion.R[0, body].T @ reach[body])
            return motion.x[:, body] - half, motion.x[:, body] + half

        x = motion.x[0]
        pin_b = 2.0 * x[0]
        pin_c = 2.0 * x[1] - pin_b
        pin_d = 2.0 * x[2] - pin_c
        reach = [pin_b - x[0], pin_c - x[1], pin_c - x[2]]
        (start, b), (b2, c), (d, c2) = ends(0), ends(1), ends(2)
        open_by = max(float(np.abs(gap).max()) for gap in (start, b - b2, c - c2, d - pin_d))
        return keeps_energy(motion, tol) | {"closure": (open_by, max(1e-9, 10.0 * tol))}

    for short in (0.2, 0.5, 0.9):
        angles = (math.pi / 3.0, 0.0, math.pi / 3.0)
        for rate in (1.0, 100.0):
            deck = linkage((1.0, short, 1.0, short), angles, rate)
            yield Deck("folding", f"crank {short:g} at {rate:g} rad/s", deck, COMPLIANT, closes)


def many_steps() -> Iterator[Deck]:
    """Yield a stiff oscillator that is followed for 1e4 periods."""
    rate = 1e3
    exact_energy = 0.5 * rate**2 * 1e-2

    def oscillates(motion: Motion, tol: float) -> Measures:
        stored = 0.5 * rate**2 * motion.x[:, 0, 0] ** 2
        off = np.abs(motion.kinetic + stored - exact_energy).max() / exact_energy
        return {"energy": (float(off), min(0.02, 1e4 * tol))}

    statements = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 1.0, (1.0, 1.0, 1.0), (0.1, 0.0, 0.0)),
        spring(1, 20, 10, rate**2, 0.0),
    ]
    deck = text.deck("An oscillator", statements, 2e4 * math.pi / rate, 200.0 * math.pi / rate)
    yield Deck(
        "many steps", "1e4 periods", deck, (*EXPLICIT, "AUTO"), oscillates,
        stored=exact_energy, tols=(1e-6, 1e-8, 1e-10),
    )  # fmt: skip


def decks() -> Iterator[Deck]:
    """Yield all decks of mechanisms."""
    for family in (springs, pendulums, spinning, overconstrained, folding, many_steps):
        yield from family()

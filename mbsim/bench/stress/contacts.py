"""Contacts: stiff, damped, slow to slip, of unlike masses, small and large, deep and fast."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench.parameters import GRAVITY as G
from mbsim.bench.stress.case import ALL, EXPLICIT, IMPLICIT, Check, Deck, Measures, Motion

FLOOR = (text.GROUND, text.FLOOR)


def box(number: int, lengths: tuple[float, float, float]) -> str:
    """Return a box about the cg of a body, graphic `100 number`."""
    sizes = {f"length_{n}": float(x) for n, x in zip("xyz", lengths, strict=True)}
    facts = text.attributes(
        id=100 * number, type="BoxDefinedFromCenter", center_marker_id=10 * number, **sizes
    )
    return f"<Post_Graphic {facts}/>"


def box_inertia(mass: float, lengths: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the principal moments of a solid box."""
    a, b, c = (x * x for x in lengths)
    return mass * (b + c) / 12.0, mass * (a + c) / 12.0, mass * (a + b) / 12.0


def solid_box(
    number: int,
    mass: float,
    lengths: tuple[float, float, float],
    position: tuple[float, float, float],
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> str:
    """Return a body that is a solid box."""
    inertia = box_inertia(mass, lengths)
    return f"{text.body(number, mass, inertia, position, velocity, spin)}\n{box(number, lengths)}"


def rebound(height: float, radius: float) -> Check:
    """Return the check of a ball that fell from `height` and flies again without loss."""

    def check(motion: Motion, tol: float) -> Measures:
        free = (motion.time > 1.05 * math.sqrt(2.0 * height / G)) & (
            motion.x[:, 0, 2] > 1.1 * radius
        )
        if not free.any():
            return {"rebound": (1.0, 0.0)}
        off = np.abs(motion.energy[free] - motion.energy[0]).max()
        return {"rebound": (float(off / (motion.weight[0] - motion.weight.min())), 30.0 * tol)}

    return check


def dropped(
    mass: float, radius: float, height: float, law: dict[str, object], friction: bool = False
) -> str:
    """Return a ball that falls on a plane, for two and a quarter times its fall."""
    fall = math.sqrt(2.0 * height / G)
    slip = text.coulomb(0.3, 1e-3 * math.sqrt(G * height)) if friction else {}
    return text.deck(
        "A ball falls",
        [
            *FLOOR,
            text.sphere(2, mass, radius, (0.0, 0.0, radius + height)),
            text.contact(1, [200], [100], **law, **slip),
            text.gravity(),
        ],
        2.25 * fall,
        fall / 20.0,
    )


def stiffness() -> Iterator[Deck]:
    """Yield balls on springs from soft to hard, undamped and damped without end."""
    for k in (1e4, 1e7, 1e10, 1e13, 1e15):
        hard = text.impact(k, 1.5, 0.0, 1e-4)
        yield Deck("stiffness", f"k={k:g}", dropped(1.0, 0.05, 0.2, hard), ALL, rebound(0.2, 0.05))
    for c, methods in ((1e3, ALL), (1e5, ALL), (1e7, (*IMPLICIT, "MOREAU"))):
        damped = text.impact(1e7, 1.5, c, 1e-4)
        yield Deck("damping", f"c={c:g}", dropped(1.0, 0.05, 0.2, damped, True), methods)


def transitions() -> Iterator[Deck]:
    """Yield balls that roll down a slope: friction's slope at slip 0 from mild to steep."""
    angle, end, radius = 0.2, 0.1, 0.05

    def rolls(speed: float) -> Check:
        def check(motion: Motion, tol: float) -> Measures:
            # it creeps by what friction needs of its transition speed
            way = 5.0 / 14.0 * G * math.sin(angle) * end**2
            allowed = 2e-3 + (2.0 * speed * end + 10.0 * tol * radius) / way
            return {"way": (abs(motion.x[-1, 0, 0] / way - 1.0), allowed)}

        return check

    for speed in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        law = text.impact(1e6, 1.0, 500.0, 1e-4) | text.coulomb(0.5, speed)
        sag = G * math.cos(angle) / 1e6
        statements = [
            *FLOOR,
            text.sphere(2, 1.0, radius, (0.0, 0.0, radius - sag)),
            text.contact(1, [200], [100], **law),
            text.gravity(G * math.sin(angle), -G * math.cos(angle)),
        ]
        deck = text.deck("A ball rolls down", statements, end, 0.01)
        # a rigid plane lifts it out of its sag
        stored = G * sag
        yield Deck("transition speed", f"vs={speed:g}", deck, ALL, rolls(speed), stored)


def masses() -> Iterator[Deck]:
    """Yield stacks of two boxes, heavy on light and light on heavy, that rest."""
    side = (0.1, 0.1, 0.1)

    def rests(motion: Motion, tol: float) -> Measures:
        # nothing may move but what the sag under the weight is
        way = np.linalg.norm(motion.x[-1] - motion.x[0], axis=-1).max()
        return {"way": (float(way), 2e-4 + 10.0 * tol * 0.15)}

    for ratio in (1e2, 1e4, 1e6):
        for lower, upper in ((1.0, ratio), (ratio, 1.0)):
            k = 1e6 * max(lower, upper)
            law = text.impact(k, 1.0, 20.0 * math.sqrt(k * min(lower, upper)), 1e-5)
            law |= text.coulomb(0.5, 1e-3)
            statements = [
                *FLOOR,
                solid_box(2, lower, side, (0.0, 0.0, 0.05)),
                solid_box(3, upper, side, (0.0, 0.0, 0.15)),
                text.contact(1, [200], [100], **law),
                text.contact(2, [300], [200], **law),
                text.gravity(),
            ]
            deck = text.deck("A box on a box", statements, 0.05, 0.005)
            yield Deck("mass ratio", f"{lower:g} under {upper:g}", deck, ALL, rests)


def spins() -> Iterator[Deck]:
    """Yield balls that fall on a plane at 1e4 rad/s, with friction from weak to strong."""
    for mu in (0.1, 1.0):
        law = text.impact(1e7, 1.5, 50.0, 1e-4) | text.coulomb(mu, 1e-2)
        spin = (6e3, -7e3, 4e3)
        statements = [
            *FLOOR,
            text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.06), (1.0, 0.0, -1.0), spin),
            text.contact(1, [200], [100], **law),
            text.gravity(),
        ]
        deck = text.deck("A ball that spins falls", statements, 0.2, 0.01)
        yield Deck("spin", f"ball mu={mu:g}", deck, ALL)


def sizes() -> Iterator[Deck]:
    """Yield the same fall from micrometres to kilometres."""
    for size in (1e-6, 1e-3, 1.0, 1e3):
        mass, height = 1e3 * size**3, 4.0 * size
        # a sag of 1e-5 of the size whatever the size
        law = text.impact(mass * G / (1e-5 * size), 1.0, 0.0, 1e-4 * size)
        deck = dropped(mass, size, height, law)
        yield Deck("size", f"R={size:g} m", deck, ALL, rebound(height, size))


def thin_and_fast() -> Iterator[Deck]:
    """Yield bodies that could be behind a wall before anything saw them."""
    law = text.impact(1e9, 1.5, 0.0, 1e-5)

    def deepest(mass: float, speed: float) -> float:
        """Return how deep one point goes that takes all energy, m."""
        return float((2.5 * 0.5 * mass * speed**2 / 1e9) ** 0.4)

    def above(depth: float) -> Check:
        """Return the check that the body's middle stays where it was, but for `depth`."""

        def check(motion: Motion, tol: float) -> Measures:
            return {"beyond": (float(max(0.0, -motion.x[:, 0, 2].min())), depth)}

        return check

    for speed in (1e2, 1e3, 1e4):
        ball = [
            text.GROUND,
            text.marker(10, 1, (0.0, 0.0, 0.0)),
            '<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10" '
            'length_x="1.0" length_y="1.0" length_z="0.001"/>',
            text.sphere(2, 1e-4, 0.01, (0.0, 0.0, 0.5), (0.0, 0.0, -speed)),
            text.contact(1, [200], [100], **law),
        ]
        deck = text.deck("A ball against a sheet", ball, 1.0 / speed, 0.05 / speed)
        yield Deck("thin and fast", f"ball on a sheet, {speed:g} m/s", deck, ALL, above(0.0))
        side, spin = (0.2, 0.2, 1e-3), (0.5 * speed, 0.03 * speed, 0.0)
        plate = [
            *FLOOR,
            solid_box(2, 1.0, side, (0.0, 0.0, 0.3), (0.0, 0.0, -speed), spin),
            text.contact(1, [200], [100], **law),
        ]
        deck = text.deck("A sheet against a plane", plate, 0.6 / speed, 0.03 / speed)
        # some of its energy is that of its spin
        depth = 1.2 * deepest(1.0, speed)
        yield Deck("thin and fast", f"sheet on a plane, {speed:g} m/s", deck, ALL, above(depth))


def overlaps() -> Iterator[Deck]:
    """Yield bodies that begin deep in each other."""
    k = 1e5
    law = text.impact(k, 1.0, 0.0, 1e-3)
    for depth in (0.01, 0.05, 0.09):
        ball = [*FLOOR, text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.05 - depth))]
        ball += [text.contact(1, [200], [100], **law), text.gravity()]
        deck = text.deck("A ball in the floor", ball, 0.1, 0.005)
        yield Deck("overlap", f"ball {depth:g} m", deck, ALL, stored=0.5 * k * depth**2)
        cube = [*FLOOR, solid_box(2, 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.05 - depth))]
        cube += [text.contact(1, [200], [100], **law), text.gravity()]
        deck = text.deck("A box in the floor", cube, 0.1, 0.005)
        yield Deck("overlap", f"box {depth:g} m", deck, ALL, stored=2.0 * k * depth**2)
    for apart in (0.05, 1e-9, 0.0):
        two = [
            text.GROUND,
            text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.0)),
            text.sphere(3, 1.0, 0.05, (0.0, 0.0, apart)),
            text.contact(1, [200], [300], **law),
        ]
        deck = text.deck("Two balls in each other", two, 0.05, 0.005)
        stored = 0.5 * k * (0.1 - apart) ** 2
        yield Deck("overlap", f"two balls {apart:g} m apart", deck, ALL, stored=stored)


def painleve() -> Iterator[Deck]:
    """Yield rods that slide on their tip where rigid friction has no answer or two."""
    length, radius, mass = 1.0, 0.01, 1.0
    inertia = mass * length**2 / 12.0
    for mu in (0.5, 1.5, 3.0):
        for angle in (0.8, 1.0, 1.2):
            law = text.impact(1e7, 1.0, 100.0, 1e-5) | text.coulomb(mu, 1e-3)
            # the rod's tip goes ahead of the cg, which leans over it
            c, s = 0.5 * length * math.cos(angle), 0.5 * length * math.sin(angle)
            tip = text.attributes(id=200, type="Sphere", center_marker_id=21, radius=radius)
            statements = [
                *FLOOR,
                text.body(
                    2, mass, (inertia, inertia, inertia), (-c, 0.0, s + radius), (4.0, 0.0, 0.0)
                ),
                text.marker(21, 2, (0.0, 0.0, radius)),
                f"<Post_Graphic {tip}/>",
                text.contact(1, [200], [100], **law),
                text.gravity(),
            ]
            deck = text.deck("Painleve's rod", statements, 0.1, 0.005)
            yield Deck("Painleve", f"mu={mu:g} angle={angle:g}", deck, ALL)


def wedged() -> Iterator[Deck]:
    """Yield balls that are shot between two walls that close in."""
    for half in (0.02, 0.1, 0.5):
        for mu in (0.0, 0.8):
            axes = []
            for side in (1.0, -1.0):
                # walls through the origin, half an angle from z, that face each other
                n = np.array([side * math.cos(half), 0.0, math.sin(half)])
                a = np.array([0.0, 1.0, 0.0])
                axes.append(np.stack([a, np.cross(n, a), n], axis=1).tolist())
            law = text.impact(1e7, 1.0, 100.0, 1e-5) | (text.coulomb(mu, 1e-3) if mu else {})
            radius = 0.05
            height = 1.2 * radius / math.sin(half)
            statements = [
                text.GROUND,
                text.marker(10, 1, (0.0, 0.0, 0.0), axes[0]),
                text.marker(11, 1, (0.0, 0.0, 0.0), axes[1]),
                '<Post_Graphic id="100" type="Plane" rm_id="10"/>',
                '<Post_Graphic id="101" type="Plane" rm_id="11"/>',
                text.sphere(2, 1.0, radius, (0.0, 0.0, height), (0.0, 0.0, -5.0)),
                text.contact(1, [200], [100, 101], **law),
                text.gravity(),
            ]
            deck = text.deck("A ball in a wedge", statements, 1.0 * height / 5.0 + 0.05, 0.02)
            yield Deck("wedged", f"half angle {half:g} mu={mu:g}", deck, ALL)


def at_once() -> Iterator[Deck]:
    """Yield several impacts at one time."""

    def momentum(motion: Motion, tol: float) -> Measures:
        # all masses are equal, and nothing is outside
        total = motion.v.sum(axis=1)
        off = np.linalg.norm(total - total[0], axis=-1).max() / np.linalg.norm(total[0])
        return {"momentum": (float(off), motion.errors(tol))}

    for e in (1.0, 1.5):
        for gap in (0.0, 1e-4):
            law = text.impact(1e7, e, 0.0, 1e-5)
            statements = [text.GROUND, text.sphere(2, 1.0, 0.05, (-0.2, 0.0, 0.0), (2.0, 0.0, 0.0))]
            statements += [
                text.sphere(3 + k, 1.0, 0.05, ((0.1 + gap) * k, 0.0, 0.0)) for k in range(4)
            ]
            statements += [
                text.contact(k, [100 * (k + 1)], [100 * (k + 2)], **law) for k in range(1, 5)
            ]
            deck = text.deck("Balls in a row", statements, 0.2, 0.01)
            yield Deck("at once", f"row e={e:g} gap={gap:g}", deck, ALL, momentum)
    law = text.impact(1e7, 1.5, 0.0, 1e-5)
    half, far = 0.05, 0.05 * math.sqrt(3.0)
    statements = [
        text.GROUND,
        text.sphere(2, 1.0, 0.05, (-0.3, 0.0, 0.0), (2.0, 0.0, 0.0)),
        text.sphere(3, 1.0, 0.05, (far, half, 0.0)),
        text.sphere(4, 1.0, 0.05, (far, -half, 0.0)),
        *(
            text.contact(k, [i], [j], **law)
            for k, (i, j) in enumerate(((200, 300), (200, 400), (300, 400)), 1)
        ),
    ]
    deck = text.deck("A ball between two", statements, 0.3, 0.01)
    yield Deck("at once", "one on two", deck, ALL, momentum)


def rest() -> Iterator[Deck]:
    """Yield bodies that lie still for 1e4 s."""

    def lies(motion: Motion, tol: float) -> Measures:
        late = motion.time > 0.01 * motion.time[-1]
        way = np.linalg.norm(motion.x[late] - motion.x[late][0], axis=-1).max()
        return {"drift": (float(way), 1e-6)}

    for name, slip in (
        ("COULOMB_ON", text.coulomb(0.5, 1e-3)),
        ("STICTION", {"cff_type": "STICTION", "mu_static": 0.5, "mu_dynamic": 0.4}),
    ):
        law = text.impact(1e5, 1.0, 200.0, 1e-4)
        ball = [*FLOOR, text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.05))]
        cube = [*FLOOR, solid_box(2, 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.05))]
        for what, statements in (("ball", ball), ("box", cube)):
            whole = [*statements, text.contact(1, [200], [100], **law, **slip), text.gravity()]
            deck = text.deck("Rest", whole, 1e4, 100.0)
            methods = (*IMPLICIT, "MOREAU")
            yield Deck("rest", f"{what} {name} for 1e4 s", deck, methods, lies)


def many_steps() -> Iterator[Deck]:
    """Yield a ball that bounces a thousand times, in some 1e6 steps."""
    law = text.impact(1e6, 1.0, 0.0, 1e-4)
    statements = [
        *FLOOR,
        text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.051)),
        text.contact(1, [200], [100], **law),
        text.gravity(),
    ]
    deck = text.deck("A ball bounces", statements, 30.0, 1.0)
    yield Deck(
        "many steps", "bounces for 30 s", deck, (*EXPLICIT, "AUTO"), tols=(1e-7, 1e-9, 1e-11)
    )


def decks() -> Iterator[Deck]:
    """Yield all decks of contacts."""
    for family in (
        *(stiffness, transitions, masses, spins, sizes, thin_and_fast, overlaps, painleve),
        *(wedged, at_once, rest, many_steps),
    ):
        yield from family()

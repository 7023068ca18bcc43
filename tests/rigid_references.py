"""Writes tables and large decks of `models/rigid/`.

python tests/rigid_references.py [NAME]...

Tables are of positions of centres of mass at the deck's rows, by equations of one or three
coordinates that share no code with the simulator. Decks of many bodies are those of the benchmark
with MOREAU as their method. `tests/models/test_rigid_decks.py` holds every deck to its reference.
"""

from __future__ import annotations

import math
import re
import sys

import numpy as np
from scipy.integrate import solve_ivp

import mbsim
from helpers import woodpecker
from helpers.folders import MODELS
from mbsim.bench.scenes import all_scenes

FOLDER, G = MODELS / "rigid", 9.81
EXACT = {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853"}


def rocking_block(times):
    """x and z of a block of half width and height that leans over its edge at x = 0 by 0.12 rad."""
    half, high, lean = 0.1, 0.4, 0.12
    radius, alpha = math.hypot(half, high), math.atan2(half, high)
    kept = 1.0 - 1.5 * math.sin(alpha) ** 2

    def rhs(t, y):
        return [y[1], -0.75 * G / radius * math.sin(alpha - y[0])]

    def upright(t, y):
        return y[0]

    upright.terminal, upright.direction = True, -1
    # y: how far it leans over the edge that it stands on, whichever that is
    now, start, over, angle = 0.0, [lean, 0.0], 1.0, np.zeros(len(times))
    while now < times[-1] and max(abs(start[0]), abs(start[1])) > 1e-9:
        found = solve_ivp(rhs, (now, times[-1]), start, events=upright, dense_output=True, **EXACT)
        here = (times >= now) & (times <= found.t[-1])
        if here.any():
            angle[here] = over * found.sol(times[here])[0]
        now, over = found.t[-1], -over
        start = [0.0, -kept * found.y[1, -1]]
    a = np.abs(angle)
    x = np.where(angle >= 0.0, 1.0, -1.0) * (high * np.sin(a) - half * np.cos(a))
    x = np.where(angle >= 0.0, x, x - 2.0 * half)
    return np.stack([x, half * np.sin(a) + high * np.cos(a)], axis=1)


def painleve_rod(times):
    """x and z of a rod of 1 m and 1 kg that stops on its tip, a ball of 1 mm, and turns over.

    The tip rolls, and slides where its friction would be more than 1.6 of the normal force. Where
    the other one lands both rest: normal impulses that stop the rod are positive at both, and
    friction may be more than what it still slides with.
    """
    half, tip, mu, angle, speed = 0.5, 1e-3, 1.6, math.radians(60.0), -3.0

    def inertia(a):
        """About the point that touches."""
        return 1.0 / 12.0 + (half * math.cos(a)) ** 2 + (tip + half * math.sin(a)) ** 2

    def rolls(t, y):
        a, w = y[0], y[1]
        rate = -half * math.cos(a) * (G + tip * w * w) / inertia(a)
        x = -tip * rate - half * (math.sin(a) * rate + math.cos(a) * w * w)
        return [w, rate, y[3], x]

    def slides(t, y):
        # w' = (mu high - half cos a) N / I, N = g + half (cos a w' - sin a w^2)
        a, w = y[0], y[1]
        arm = 12.0 * (mu * (tip + half * math.sin(a)) - half * math.cos(a))
        press = (G - half * math.sin(a) * w * w) / (1.0 - arm * half * math.cos(a))
        return [w, arm * press, y[3], mu * press]

    def yields(t, y):
        rates = rolls(t, y)
        press = G + half * (math.cos(y[0]) * rates[1] - math.sin(y[0]) * y[1] ** 2)
        return mu * press - abs(rates[3])

    def lands(t, y):
        return y[0] - math.pi

    first = -speed * (tip + half * math.sin(angle)) / inertia(angle)
    y = [angle, first, 0.0, -(tip + half * math.sin(angle)) * first]
    now, found = 0.0, np.empty((len(times), 2))
    for rhs, event in ((rolls, yields), (slides, lands)):
        event.terminal = True
        solved = solve_ivp(rhs, (now, times[-1]), y, events=event, dense_output=True, **EXACT)
        here = times >= now
        a, _, x, _ = solved.sol(np.minimum(times[here], solved.t[-1]))
        found[here] = np.stack([x, tip + half * np.sin(a)], axis=1)
        now, y = solved.t[-1], solved.y[:, -1]
    return found


def woodpecker_toy(times):
    """y of the sleeve, and x and y of the bird."""
    start = (0.0, -0.1, -0.2788, -0.3411, 0.0, -7.4583)
    y, a, b = woodpecker.solve(start, times, 5e-7, tip=1e-4).T[:3]
    to_spring, to_bird = woodpecker.TO_SPRING, woodpecker.TO_BIRD
    x = to_spring * np.cos(a) + to_bird * np.cos(b)
    return np.stack([y, x, y + to_spring * np.sin(a) + to_bird * np.sin(b)], axis=1)


#: Name -> columns and what gives them.
TABLES = {
    "rocking_block": (("2/x", "2/z"), rocking_block),
    "painleve_rod": (("2/x", "2/z"), painleve_rod),
    "woodpecker": (("2/y", "3/x", "3/y"), woodpecker_toy),
}

#: Name -> scene of the benchmark and its variation, attributes of its step, what stands on top.
SCENES = {
    "cube_stack": (
        ("S6", {"stiction": 1.0}),
        {"integr_tol": "1e-6"},
        """Ten cubes stand on each other for 10 s

     Reference: they stay where they are, and each carries the weight of those above it.""",
    ),
    "heavy_on_light": (
        ("S10b", {"stiction": 1.0}),
        {},
        """A cube of 10 t stands on one of 1 kg

     Reference: both stay where they are, and the floor carries their weight.""",
    ),
    "spheres_in_box": (
        ("S7_125", {"k": 1e5}),
        {"integr_tol": "0.1", "h_max": "0.001", "h_min": "0.001"},
        """125 spheres fall into an open box

     Reference: at rest the floor carries their weight, opposite walls push alike, and no sphere has
     been deeper than 0.05 radii in anything. Their mean height at 2 s is 0.0647 to 0.0667 m by
     MuJoCo, 0.0681 to 0.0698 by ODE, 0.0674 to 0.0701 by PyBullet (mbsim bench S7_125).""",
    ),
    "boxes_in_bin": (
        ("bin_50", {}),
        {"integr_tol": "0.1", "h_max": "0.002", "h_min": "0.002"},
        """50 cubes fall into an open box

     Reference: at rest the floor carries their weight, opposite walls push alike; no overlap of
     2 mm in any row, by separating axes.""",
    ),
    "balls_on_box": (
        ("sb_rolling", {}),
        {"integr_tol": "1e-4"},
        """25 balls roll on a box that is pushed over the floor: SimBenchmark's rolling scene

     Reference: closed form. The box goes at 0.7385 m/s^2, balls that do not slip at 2/7 of that.
     Published means of the squared velocity errors: Bullet 7.3e-28, ODE 7.6e-9, RaiSim 4.1e-7,
     MuJoCo 2.0e-3 m^2/s^2 (D. Kang, J. Hwangbo, SimBenchmark, 2018).""",
    ),
    "bouncing_balls": (
        ("sb_bouncing", {}),
        {},
        """49 elastic balls bounce for 20 s: SimBenchmark's bouncing scene

     Reference: closed form, parabolas of one height, and the energy. Best published mean of
     (E - E0)^2: RaiSim, 1.9e-10 J^2 (D. Kang, J. Hwangbo, SimBenchmark, 2018).""",
    ),
    "balls_666": (
        ("sb_666", {}),
        {"integr_tol": "0.1", "h_max": "0.005", "h_min": "0.005"},
        """216 balls fall in a heap: SimBenchmark's scene 666

     Reference: best published mean of the sum of squared depths: DART, 2.0e-7 m^2; the floor
     carries their weight when they are at rest (D. Kang, J. Hwangbo, SimBenchmark, 2018).""",
    ),
    "balls_666_elastic": (
        ("sb_666_elastic", {}),
        {},
        """216 elastic balls fall in a heap: SimBenchmark's elastic scene 666

     Reference: the energy stays. Best published mean of (E - E0)^2: RaiSim, 1.1e-3 J^2
     (D. Kang, J. Hwangbo, SimBenchmark, 2018).""",
    ),
}


def path(name):
    return FOLDER / f"{name}.xml"


def table(name):
    """Return times (rows,) [s], names of columns and positions (rows, columns) [m]."""
    file = path(name).with_suffix(".csv")
    lines = [line for line in file.read_text("utf-8").splitlines() if not line.startswith("#")]
    rows = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    return rows[:, 0], lines[0].split(",")[1:], rows[:, 1:]


def deck(name):
    """Return the text of a deck that is a scene of the benchmark."""
    (scene, variation), step, comment = SCENES[name]
    text = all_scenes()[scene].deck(variation)
    title, _, more = comment.partition("\n")
    text = re.sub(
        r"<!-- .*? -->", lambda _: f"<!-- {title} (units N, kg, m, s).\n{more}\n-->", text, count=1
    )
    steps = "".join(f' {key}="{value}"' for key, value in step.items())
    method = f'<Param_Transient integrator_type="MOREAU"{steps}/>'
    return text.replace("<Body_Rigid", f"{method}\n<Body_Rigid", 1)


def write(name):
    """Write what this script has of a deck."""
    if name in SCENES:
        path(name).write_text(deck(name), encoding="utf-8")
        return
    columns, solve = TABLES[name]
    simulation = mbsim.read_model(path(name)).simulations[0]
    rows = round(simulation.end_time / simulation.print_interval)
    times = np.linspace(0.0, simulation.end_time, rows + 1)
    lines = [
        "# positions [m] of centres of mass, by no code of the simulator",
        f"# python tests/rigid_references.py {name}",
        ",".join(["time", *columns]),
    ]
    for t, row in zip(times, solve(times), strict=True):
        lines.append(",".join(f"{value:.9g}" for value in (t, *row)))
    path(name).with_suffix(".csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    for name in sys.argv[1:] or [*TABLES, *SCENES]:
        write(name)

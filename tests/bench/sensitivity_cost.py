"""What derivatives cost: evaluations beside a run, over the run's own, deck by deck.

    python tests/bench/sensitivity_cost.py
    python tests/bench/sensitivity_cost.py --seconds

prints a row for each deck and method: evaluations of the run, and what the first parameter and
each further one take beside it, over that. Evaluations are exact; `--seconds` adds the same of the
time that the loop takes, the least of five, which scatters with what else the machine does.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mbsim

MODELS = Path(__file__).parents[2] / "models"
#: Of each deck: parameters, the first one first.
DECKS = {
    "free_top": (
        "Body_Rigid[2].inertia_xx",
        "Body_Rigid[2].inertia_yy",
        "Body_Rigid[2].inertia_zz",
    ),
    "bowling_ball": ("Force_Contact[301].damping", "Body_Rigid[2].v_ic_x", "Body_Rigid[2].mass"),
    "sdnd100": ("Force_Contact[301].mu_dynamic", "Body_Rigid[2].mass"),
    "belt_stick_slip": ("Force_Contact[301].mu_static", "Force_Contact[301].mu_dynamic"),
    "bouncing_sphere": ("Reference_Marker[20].pos_z", "Body_Rigid[2].mass"),
}
METHODS, TOL, TIMES = ("RADAU5", "DOPRI5", "DOP853", "GALPHA"), 1e-8, 5


def cost(deck: str, method: str, names: tuple[str, ...], times: int) -> tuple[int, int, float]:
    """Return evaluations of a run, those of its derivatives, and the loop's seconds."""
    least = float("inf")
    for _ in range(times):
        run = mbsim.simulate(
            MODELS / f"{deck}.xml", integrator=method, tol=TOL, sensitivity=list(names)
        )
        least = min(least, run.stats["loop_s"])
    beside = run.parameters[names[0]]["evaluations"] if names else 0
    return int(run.stats["rhs_evaluations"]), beside, least


def row(deck: str, method: str, names: tuple[str, ...], times: int) -> str:
    """Return a row of the table; with times > 1 what seconds say is in it too."""
    own, first, with_first = cost(deck, method, names[:1], times)
    _, all_of_them, with_all = cost(deck, method, names, times)
    more = len(names) - 1
    text = f"{deck:16} {method:7} {own:7d} {first / own:6.2f}"
    text += f" {(all_of_them - first) / more / own:7.2f}"
    if times > 1:
        _, _, alone = cost(deck, method, (), times)
        text += f"  {1e3 * alone:7.1f} {with_first / alone - 1.0:6.2f}"
        text += f" {(with_all - with_first) / more / alone:7.2f}"
    return text


def main() -> None:
    """Print the table."""
    times = TIMES if "--seconds" in sys.argv[1:] else 1
    head = f"{'deck':16} {'method':7} {'run':>7} {'first':>6} {'further':>7}"
    print(head + (f"  {'ms':>7} {'first':>6} {'further':>7}" if times > 1 else ""))
    for deck, names in DECKS.items():
        for method in METHODS:
            print(row(deck, method, names, times), flush=True)


if __name__ == "__main__":
    main()

"""What derivatives cost: evaluations beside a run, over the run's own, deck by deck.

    python tests/bench/sensitivity_cost.py

prints a row for each deck and method: evaluations of the run, and what the first parameter and
each further one take beside it, over that. Evaluations are exact; seconds of both agree with them
to a fifth.
"""

from __future__ import annotations

from pathlib import Path

import mbsim

MODELS = Path(__file__).parents[2] / "models"
#: Of each deck: parameters, the first one first.
DECKS = {
    "free_top": ("Body_Rigid[2].mass", "Body_Rigid[2].inertia_xx", "Body_Rigid[2].inertia_zz"),
    "bowling_ball": ("Force_Contact[301].damping", "Body_Rigid[2].v_ic_x", "Body_Rigid[2].mass"),
    "sdnd100": ("Force_Contact[301].mu_dynamic", "Body_Rigid[2].mass"),
    "belt_stick_slip": ("Force_Contact[301].mu_static", "Force_Contact[301].mu_dynamic"),
    "bouncing_sphere": ("Reference_Marker[20].pos_z", "Body_Rigid[2].mass"),
}
METHODS, TOL = ("RADAU5", "DOPRI5", "DOP853", "GALPHA"), 1e-8


def evaluations(deck: str, method: str, names: tuple[str, ...]) -> tuple[int, int, float]:
    """Return evaluations of a run, those of its derivatives, and until when these are known."""
    run = mbsim.simulate(
        MODELS / f"{deck}.xml", integrator=method, tol=TOL, sensitivity=list(names)
    )
    stats, about = run.stats, run.parameters
    known = min(about[name]["known_until"] for name in names)
    return (
        stats["rhs_evaluations"] + stats["implicit_evaluations"],
        about[names[0]]["evaluations"],
        known,
    )


def main() -> None:
    """Print the table."""
    print(f"{'deck':16} {'method':7} {'run':>7} {'first':>6} {'further':>7}  known until")
    for deck, names in DECKS.items():
        for method in METHODS:
            own, first, _ = evaluations(deck, method, names[:1])
            _, all_of_them, known = evaluations(deck, method, names)
            further = (all_of_them - first) / (len(names) - 1) / own
            print(
                f"{deck:16} {method:7} {own:7d} {first / own:6.2f} {further:7.2f}  {known:g}",
                flush=True,
            )


if __name__ == "__main__":
    main()

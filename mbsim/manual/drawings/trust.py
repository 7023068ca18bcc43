"""Pictures of the chapter Trust: runs as lines, references as dots."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.bench import stiff
from mbsim.manual.drawings import runs
from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Reference = Callable[[Any, Any], Any]
#: Points drawn of a reference and of a run, in each of many panels.
_DOTS, _LINE = 20, 150


def _compare(axes: Axes, title: str, run: Any, signal: Any, reference: Any) -> None:
    """Draw a signal as a line, its reference as dots, and say how far they are apart."""
    times, signal = run["time"], np.asarray(signal)
    reference = np.broadcast_to(reference, signal.shape)
    some = np.unique(np.linspace(0, len(times) - 1, _DOTS).astype(int))
    thin = np.unique(np.linspace(0, len(times) - 1, _LINE).astype(int))
    axes.plot(times[thin], signal[thin], linewidth=1.0)
    axes.plot(times[some], reference[some], ".", color="C3", markersize=4)
    apart = np.nanmax(np.abs(signal - reference))
    axes.set_title(f"{title}\nlargest difference {apart:.0e}", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.locator_params(nbins=4)


def _grid(figure: Figure, count: int, columns: int = 3) -> list[Axes]:
    """Return `count` panels in rows of `columns`."""
    import matplotlib

    matplotlib.rcParams["svg.fonttype"] = "none"  # as paths the words of many panels are too large
    rows = -(-count // columns)
    panels = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))
    for axes in panels[count:]:
        axes.set_axis_off()
    return panels[:count]


def _rolling(t: Any, v0: float, mu: float, g: float = 9.81) -> Any:
    """Return the speed of a rigid ball that slides, then rolls."""
    return np.where(t < 2 * v0 / (7 * mu * g), v0 - mu * g * t, 5 * v0 / 7)


def _to_rest(t: Any, v0: float, mu: float, g: float = 9.81) -> Any:
    """Return the way of a block that slides to rest."""
    t = np.minimum(t, v0 / (mu * g))
    return v0 * t - 0.5 * mu * g * t**2


@picture("verification-contact.svg", height=6.6)
def contact(figure: Figure) -> None:
    """Nine decks of contact and friction."""
    known = runs.references()
    g, slope = 9.81, np.radians(20.0)
    cases: list[tuple[str, str, str, Callable[[Any], Any]]] = [
        ("bouncing_sphere", "bodies/2/position/z", "height [m]",
         lambda t: known.drop_height(t, 0.6, 0.1, 1.0, 1e8, 1.5, 200.0, 1e-4)),
        ("bowling_ball", "bodies/2/velocity/x", "speed [m/s]", lambda t: _rolling(t, 5.0, 0.2)),
        ("incline_creep", "bodies/2/velocity/x", "creep [m/s]", lambda t: 0.53688e-3 + 0 * t),
        ("incline_slip", "bodies/2/position/x", "way [m]",
         lambda t: 0.5 * g * (np.sin(slope) - 0.2 * np.cos(slope)) * t**2),
        ("sliding_block", "bodies/2/position/x", "way [m]", lambda t: _to_rest(t, 5.0, 0.5)),
        ("stiction_incline", "bodies/2/velocity/x", "speed [m/s]", lambda t: 0.0 * t),
        ("seed_contact", "bodies/2/velocity/x", "speed [m/s]",
         lambda t: np.where(t < 1.01, 2.0 - 0.01 * g * t, np.where(t > 9.0, 1.410860, np.nan))),
        ("pendulum_wall", "angle", "angle [rad]",
         lambda t: known.wall_pendulum(t, -np.pi / 3, 1.0, 1.0, 1.001, (1e6, 1.5, 200.0, 1e-3))),
        ("sdnd121", "bodies/2/position/x", "position [m]", lambda t: known.elastic_stop(
            t, 156.0, 2e6, 1e10, 1e-3, push=3000.0, frequency=10 * np.pi)[0]),
    ]  # fmt: skip
    for axes, (deck, signal, unit, exact) in zip(_grid(figure, len(cases)), cases, strict=True):
        run = _run(deck)
        p = run["bodies/2/position"]
        shown = np.arctan2(p[:, 0], -p[:, 2]) if signal == "angle" else run[signal]
        _compare(axes, f"{deck}: {unit}", run, shown, exact(run["time"]))


def _run(deck: str) -> Any:
    """Return the results of a deck; the seed's one needs its subroutine."""
    plugin = runs.MODELS.parent / "userfuncs" / "coulomb_stribeck.py"
    settings = {"plugins": [str(plugin)]} if deck == "seed_contact" else {}
    return runs.of_model(f"{deck}.xml", **settings)


@picture("verification-mechanisms.svg", height=4.6)
def mechanisms(figure: Figure) -> None:
    """Six mechanisms with contacts and stops."""
    known = runs.references()
    panels = _grid(figure, 6)

    run = runs.of_model("cam.xml")
    w, t = 20 * np.pi, run["time"]
    lift, rate = known.flat_follower(t, w, 0.01, 0.5, 2000.0, 100.0, 1e7, 900.0, -1.2464e-5)
    top = 0.01 * (1 - np.cos(w * t))
    force = 1e7 * (top - lift) + 900.0 * (0.01 * w * np.sin(w * t) - rate)
    _compare(panels[0], "cam: contact force [N]", run, run["contacts/301/force/z"], force)

    run = runs.of_model("four_bar_stop.xml")
    spring = (np.array([-0.1, 0.15]), 400.0, 0.15, 2.0)
    wall = (np.array([0.16, 0.0]), np.array([1.0, 0.0]), 0.02)
    law = (1e6, 1.5, 200.0, 1e-4)
    bars, masses = (0.1, 0.3, 0.2), (0.5, 1.0, 0.8)
    exact, _ = known.four_bar_on_stop(run["time"], np.pi / 3, bars, masses, 0.3, spring, wall, law)
    p = run["bodies/2/position"]
    _compare(panels[1], "four_bar_stop: crank [rad]", run, np.arctan2(p[:, 2], p[:, 0]), exact)

    run = runs.of_model("flyball_governor.xml")
    exact = known.Governor().solve(run["time"])[1]
    slider = run["bodies/3/position/z"]
    _compare(panels[2], "flyball_governor: slider [m]", run, slider, exact)

    run = runs.of_model("sdnd101.xml")
    exact, _ = known.elastic_stop(run["time"], 100.0, 1e4, 1e6, 0.0, v=1.0)
    _compare(panels[3], "sdnd101: mass on a stop [m]", run, run["bodies/2/position/x"], exact)

    run = runs.of_model("slider_crank_clearance.xml", end_time=0.04)
    place = known.loose_slider(run["time"], (1e7, 0.4, 0.01), mu=0.01, slip=0.05)[-1]
    across = run["bodies/4/position/y"]
    _compare(panels[4], "slider_crank_clearance: across [m]", run, across, place[:, 1])

    run = runs.of_model("dry_friction_element.xml")
    exact, _ = known.jenkins_block(run["time"], 1e4, 1.0, 1e-6, 8.5e-4)
    _compare(panels[5], "dry_friction_element [m]", run, run["bodies/3/position/x"], exact)


@picture("verification-stiff.svg", height=7.6)
def stiff_decks(figure: Figure) -> None:
    """All decks of `models/stiff/` against the tables beside them."""
    for axes, deck in zip(_grid(figure, len(stiff.DECKS)), stiff.DECKS, strict=True):
        times, exact = stiff.table(deck)
        run = runs.of_model(f"stiff/{deck.name}.xml")
        body, axis = deck.columns[0].split("/")
        signal = np.interp(times, run["time"], run[f"bodies/{body}/position/{axis}"])
        _compare(axes, f"{deck.name}: {body}/{axis} [m]", {"time": times}, signal, exact[:, 0])


@picture("work-precision.svg", height=3.4)
def work_precision(figure: Figure) -> None:
    """Error over evaluations of four methods, ten bounces of a sphere."""
    axes = figure.subplots()
    exact = runs.of_model("bouncing_sphere.xml", tol=1e-13, integrator="DOP853")
    for method in ("DOPRI5", "DOP853", "RADAU5", "GALPHA"):
        work, errors = [], []
        for tol in 10.0 ** -np.arange(3.0, 11.0 if method != "GALPHA" else 7.0):
            run = runs.of_model("bouncing_sphere.xml", tol=float(tol), integrator=method)
            work.append(run.stats["rhs_evaluations"])
            miss = run["bodies/2/position/z"] - exact["bodies/2/position/z"]
            errors.append(np.abs(miss).max())
        axes.loglog(work, errors, "o-", markersize=4, label=method)
    axes.set_xlabel("evaluations, tol from 1e-3 to 1e-10")
    axes.set_ylabel("largest error of the height [m]")
    axes.legend()

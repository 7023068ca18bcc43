"""Pictures of the chapter Trust: runs as lines, references as dots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import mbsim
from mbsim.bench import stiff
from mbsim.manual.drawings import runs
from mbsim.manual.pictures import picture
from mbsim.model.placement import place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Reference = Callable[[Any, Any], Any]
#: Points drawn of a reference and of a run, in each of many panels.
_DOTS, _LINE = 12, 70


def _compare(axes: Axes, title: str, run: Any, signal: Any, reference: Any) -> None:
    """Draw a signal as a line, its reference as dots, and say how far they are apart."""
    times, signal = run["time"], np.asarray(signal)
    reference = np.broadcast_to(reference, signal.shape)
    known = np.flatnonzero(np.isfinite(reference))
    some = known[np.unique(np.linspace(0, len(known) - 1, _DOTS).astype(int))]
    thin = np.unique([*np.linspace(0, len(times) - 1, _LINE).astype(int), *some])
    axes.plot(times[thin], signal[thin], linewidth=1.0)
    axes.plot(times[some], reference[some], ".", color="C3", markersize=4)
    apart = np.nanmax(np.abs(signal - reference))
    axes.set_title(f"{title}\nlargest difference {apart:.0e}", fontsize=8)
    axes.tick_params(labelsize=7)
    # 1e-13 at the corner of the panel is below the title
    axes.yaxis.get_offset_text().set(fontsize=7, x=-0.2)
    axes.locator_params(nbins=3)
    axes.grid(visible=False)


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
        ("incline_creep", "bodies/2/velocity/x", "creep [m/s]",
         lambda t: np.where(t > 1.0, 0.53688e-3, np.nan)),
        ("incline_slip", "bodies/2/position/x", "way [m]",
         lambda t: 0.5 * g * (np.sin(slope) - 0.2 * np.cos(slope)) * t**2),
        ("sliding_block", "bodies/2/position/x", "way [m]", lambda t: _to_rest(t, 5.0, 0.5)),
        ("stiction_incline", "bodies/2/velocity/x", "speed [m/s]",
         lambda t: np.where(t >= 10.0, 0.0, np.nan)),
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
    """Return the results of a deck; one needs its subroutine, one is too fast for a small panel."""
    plugin = runs.MODELS.parent / "userfuncs" / "coulomb_stribeck.py"
    settings: dict[str, dict[str, Any]] = {
        "seed_contact": {"plugins": [str(plugin)]},
        "sdnd121": {"end_time": 0.25},
    }
    return runs.of_model(f"{deck}.xml", **settings.get(deck, {}))


def _only(times: Any, known: dict[float, float]) -> Any:
    """Return values that are known at some times, NaN at the others."""
    out = np.full(len(times), np.nan)
    for t, value in known.items():
        out[min(int(np.searchsorted(times, t - 1e-9)), len(times) - 1)] = value
    return out


def _between(run: Any, first: float, after: Sequence[float]) -> Any:
    """Return a speed that is known before and between impacts, NaN within them."""
    out, t = np.full(len(run["time"]), np.nan), run["time"]
    events = [(float(row["time"]), str(row["kind"])) for row in run["events"]]
    touches = [time for time, kind in events if kind == "touch"]
    leaves = [time for time, kind in events if kind == "leave"]
    out[t < touches[0]] = first
    for k, value in enumerate(after[: len(leaves)]):
        end = touches[k + 1] if k + 1 < len(touches) else np.inf
        out[(t > leaves[k]) & (t < end)] = value
    return out


@picture("verification-more.svg", height=6.0)
def more(figure: Figure) -> None:
    """Draw nine decks whose references are laws of impact, one equation, or single numbers."""
    known = runs.references()
    panels = _grid(figure, 9)

    run = runs.of_model("hertz_sphere.xml")
    v = run["bodies/2/velocity/z"]
    _compare(panels[0], "hertz_sphere: speed [m/s]", run, v, _between(run, -0.2, [0.2]))

    run = runs.of_model("hunt_crossley_pair.xml")
    v = run["bodies/1/velocity/x"]
    _compare(panels[1], "hunt_crossley_pair [m/s]", run, v, _between(run, v[0], [-1.4]))

    run = runs.of_model("poisson_walls.xml")
    v = np.abs(run["bodies/2/velocity/z"])
    speeds = [2.0 * 0.8**n for n in range(1, 5)]
    _compare(panels[2], "poisson_walls: |v| [m/s]", run, v, _between(run, 2.0, speeds))

    run = runs.of_model("slider_crank.xml")
    bars = ((0.15, 1.0), (0.35, 0.5))
    exact = known.slider_crank(run["time"], np.pi / 4, 10.0, *bars, 0.8)
    slide = 0.15 * np.cos(exact) + np.sqrt(0.35**2 - (0.15 * np.sin(exact)) ** 2)
    _compare(panels[3], "slider_crank: slider [m]", run, run["bodies/4/position/x"], slide)

    run = runs.of_model("four_bar.xml")
    matrices = known.rotation_matrices(run["bodies/2/quaternion"])
    tip = run["bodies/2/position"][:, 0] + 0.5 * matrices[:, 0, 1]
    exact = {1.0: -0.1950203019, 5.0: -0.8113104610, 10.0: 0.3284581115, 20.0: 0.8397465743}
    _compare(panels[4], "four_bar: x of the tip [m]", run, tip, _only(run["time"], exact))

    run, other = runs.of_model("drop_m.xml"), runs.of_model("drop_mm.xml")
    in_mm = other["bodies/2/position/z"] / 1000.0
    _compare(panels[5], "drop_m: drop_mm as dots [m]", run, run["bodies/2/position/z"], in_mm)

    run = runs.of_model("lugre_stick_slip.xml")
    exact = _only(run["time"], {20.0: 1.272596})
    _compare(panels[6], "lugre_stick_slip [m]", run, run["bodies/2/position/x"], exact)

    for axes, deck in zip(panels[7:], ("sdnd100", "stiction_rigid"), strict=True):
        run = runs.of_model(f"{deck}.xml")
        x = run["bodies/2/position/x"] * np.sqrt(2.0)
        exact = _only(run["time"], {float(run["time"][-1]): 5e-5})
        _compare(axes, f"{deck}: rest at [m]", run, x, exact)


@picture("verification-others.svg", height=7.2)
def others(figure: Figure) -> None:
    """Draw the ten decks that are left."""
    known = runs.references()
    panels = _grid(figure, 10)

    run = runs.of_model("mesh_on_plane.xml")
    mass = place(mbsim.read_model(runs.MODELS / "mesh_on_plane.xml")).bodies[2].mass
    exact = known.drop_height(run["time"], 0.2, 0.1, mass, 1e6, 1.5, 100.0, 1e-3)
    _compare(panels[0], "mesh_on_plane: height [m]", run, run["bodies/2/position/z"], exact)

    run = runs.of_model("ellipsoid_on_box.xml")
    exact = known.drop_height(run["time"], 0.18, 0.08, 3.0, 1e6, 1.5, 100.0, 1e-3)
    _compare(panels[1], "ellipsoid_on_box: height [m]", run, run["bodies/2/position/z"], exact)

    run = runs.of_model("chain_on_box.xml")
    angles, law = np.radians([10.0, -20.0, 35.0]), (1e5, 1.5, 20.0, 1e-3)
    nodes = known.falling_chain(run["time"], np.array([-0.4, 0.5]), angles, 0.3, 0.2, 0.03, law)
    middle = (nodes[:, 1, 1] + nodes[:, 2, 1]) / 2
    _compare(panels[2], "chain_on_box: link 2 [m]", run, run["bodies/3/position/z"], middle)

    run = runs.of_model("sphere_pair.xml")
    v = run["bodies/1/velocity/x"]
    _compare(panels[3], "sphere_pair: speed [m/s]", run, v, _between(run, v[0], [-10.0]))

    run = runs.of_model("contensou_disc.xml")
    slip = np.linalg.norm(run["bodies/2/velocity"][:, :2], axis=1)
    rim = 0.1 * np.abs(run["bodies/2/angular_velocity"][:, 2])
    late = slip + rim < 3e-3
    exact = np.where(np.arange(len(slip)) == int(np.argmax(late)), 0.6530017892, np.nan)
    ratio = np.where(late.cumsum() <= 1, slip / np.maximum(rim, 1e-12), np.nan)
    _compare(panels[4], "contensou_disc: v/(R w)", run, ratio, exact)

    run = runs.of_model("free_top.xml")
    q = run["bodies/2/quaternion"]
    end = known.top_attitude((0.010, 0.020, 0.025), (0.01, 10, 0.02), 10, 300)
    exact = _only(run["time"], {float(run["time"][-1]): float(end[0] * np.sign(end @ q[-1]))})
    _compare(panels[5], "free_top: w of the attitude", run, q[:, 0], exact)

    run = runs.of_model("cam_roller.xml", end_time=0.05)
    law, friction = (1e9, 1.5, 900.0, 1e-7), (0.1, 0.01)
    sizes = (20 * np.pi, 0.01, 0.03, 0.01, 0.5, 5e-6, 2000.0, 2000 * (0.03 + 0.25 - 0.23))
    exact = known.roller_follower(run["time"], *sizes, law, friction, 0.0299757)[0]
    _compare(panels[6], "cam_roller: height [m]", run, run["bodies/4/position/z"], exact)

    farthest = {"belt_stick_slip": 1.0385164807, "belt_weakening": 1.133943658}
    for axes, (deck, exact) in zip(panels[7:9], farthest.items(), strict=True):
        run = runs.of_model(f"{deck}.xml")
        x = run["bodies/2/position/x"]
        top = _only(run["time"], {float(run["time"][np.argmax(x)]): exact})
        _compare(axes, f"{deck}: farthest [m]", run, x, top)

    run = runs.of_model("geneva.xml", end_time=1.0)
    t, a, r, q = run["time"], 0.1, 0.1 / np.sqrt(2), run["bodies/3/quaternion"]
    crank = np.mod(2 * np.pi * t + np.pi / 2, 2 * np.pi) - np.pi
    rigid = np.arctan2(r * np.sin(crank), a - r * np.cos(crank)) + np.pi / 4
    rigid = np.where(np.abs(crank) < np.pi / 4, rigid + np.floor(t + 1e-12) * np.pi / 2, np.nan)
    angle = np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))
    _compare(panels[9], "geneva: wheel [rad]", run, angle, rigid)


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


@picture("verification-stiff.svg", height=4.8)
def stiff_decks(figure: Figure) -> None:
    """Draw the first half of `models/stiff/` against the tables beside the decks."""
    _tables(figure, stiff.DECKS[:7])


@picture("verification-stiff-2.svg", height=4.8)
def more_stiff_decks(figure: Figure) -> None:
    """Draw the second half."""
    _tables(figure, stiff.DECKS[7:])


def _tables(figure: Figure, decks: Sequence[stiff.StiffDeck]) -> None:
    """Draw runs of stiff decks and what their tables have of one position."""
    for axes, deck in zip(_grid(figure, len(decks)), decks, strict=True):
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

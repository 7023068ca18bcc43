"""Pictures of the chapter Start: runs of the decks of its pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.manual.drawings import runs
from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@picture("first-deck.svg", height=3.8)
def first_deck(figure: Figure) -> None:
    """Velocity and slip of the thrown ball, and its friction force."""
    run = runs.of_page("start/first-deck", "ball.xml")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    upper.plot(run["time"], run["bodies/2/velocity/x"], label="velocity of the ball")
    upper.plot(run["time"][1:], run["contacts/301/slip_speed"][1:], label="slip speed")
    upper.axhline(25 / 7, color="0.5", linestyle=":", label="rolling, rigid: 5/7 of 5 m/s")
    upper.set_ylabel("m/s")
    upper.legend()
    lower.plot(run["time"], run["contacts/301/force/x"], color="C3")
    lower.set_ylabel("friction force [N]")
    lower.set_xlabel("time [s]")


@picture("mechanism.svg", height=4.4)
def mechanism(figure: Figure) -> None:
    """Lift, contact force and drive torque of the cam and its follower."""
    run = runs.of_page("start/mechanism", "follower.xml")
    panels = figure.subplots(3, 1, sharex=True)
    panels[0].plot(run["time"], 1e3 * (run["bodies/3/position/z"] - 0.025))
    panels[0].set_ylabel("lift [mm]")
    panels[1].plot(run["time"], run["contacts/301/force/z"], color="C1")
    panels[1].set_ylabel("contact force [N]")
    panels[2].plot(run["time"], run["motions/1/torque/y"], color="C3")
    panels[2].set_ylabel("drive torque [N m]")
    panels[2].set_xlabel("time [s]")

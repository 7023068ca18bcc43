"""The frame in which a friction function works."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _arrow(axes: Axes, begin: tuple[float, float], end: tuple[float, float], color: str) -> None:
    look = {"arrowstyle": "-|>", "color": color, "lw": 1.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=end, xytext=begin, arrowprops=look, zorder=4)


@picture("incident-marker.svg", width=6.0, height=3.2)
def incident_marker(figure: Figure) -> None:
    """Draw a ball I on ground J: normal, slip, and the friction on I."""
    from matplotlib.patches import Circle, Rectangle

    axes = figure.subplots()
    axes.add_patch(Rectangle((-3.2, -1.0), 6.4, 1.0, facecolor="0.85", edgecolor="0.55"))
    axes.add_patch(Circle((0.0, 1.2), 1.2, facecolor="#cfe2f3", edgecolor="C0"))
    axes.text(0.75, 1.75, "I", color="C0", fontsize=13)
    axes.text(-2.9, -0.7, "J", color="0.35", fontsize=13)
    axes.plot([0.0], [0.0], "o", color="black", markersize=5, zorder=5)
    _arrow(axes, (0.0, 0.0), (0.0, 1.0), "black")
    axes.text(0.1, 0.75, "z: normal from J into I, nforce on I")
    _arrow(axes, (0.0, 0.0), (1.0, 0.0), "black")
    axes.text(1.05, -0.08, "x", va="center")
    axes.text(-0.08, -0.3, "contact point", ha="right")
    _arrow(axes, (0.0, 0.28), (2.4, 0.28), "C1")
    axes.text(3.1, 0.4, "xdot: slip of I against J", color="C1", ha="right")
    _arrow(axes, (0.0, 0.0), (-1.8, 0.0), "C3")
    axes.text(-1.85, 0.12, "[Fx, Fy] on I", color="C3", ha="left")
    _arrow(axes, (0.0, -0.55), (1.3, -0.55), "C3")
    axes.text(1.4, -0.55, "the opposite on J", color="C3", va="center")
    axes.set(xlim=(-3.2, 3.2), ylim=(-1.05, 2.5), aspect="equal")
    axes.set_axis_off()

"""Pictures of the chapter Develop: from a deck to results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PYTHON, _COMPILED, _EDGE = "#eef3f8", "#fff3dc", "#4a5560"


def _box(axes: Axes, x: float, y: float, title: str, words: str, colour: str) -> None:
    """Draw a box about (x, y)."""
    from matplotlib.patches import FancyBboxPatch

    style = "round,pad=0.02,rounding_size=0.08"
    patch = FancyBboxPatch((x - 0.9, y - 0.36), 1.8, 0.72, boxstyle=style)
    patch.set(facecolor=colour, edgecolor=_EDGE, linewidth=1.0)
    axes.add_patch(patch)
    axes.text(x, y + 0.13, title, ha="center", va="center", fontsize=10, weight="bold")
    axes.text(x, y - 0.15, words, ha="center", va="center", fontsize=7.5)


def _arrow(axes: Axes, start: Any, end: Any, words: str = "", lift: float = 0.1) -> None:
    """Draw an arrow, with words beside its middle."""
    shape = {"arrowstyle": "-|>", "color": _EDGE, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=shape)
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0 + lift)
    axes.text(*middle, words, ha="center", va="center", fontsize=7.5)


@picture("structure.svg", width=7.4, height=4.6)
def structure(figure: Figure) -> None:
    """Draw what a run goes through: Python outside, the compiled loop inside."""
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set(xlim=(-1.1, 7.3), ylim=(-0.5, 4.55))
    from matplotlib.patches import FancyBboxPatch

    loop = FancyBboxPatch((-0.95, 0.55), 8.1, 2.05, boxstyle="round,pad=0.02,rounding_size=0.1")
    loop.set(facecolor=_COMPILED, edgecolor="#b58a2a", linewidth=1.0)
    axes.add_patch(loop)
    axes.text(
        1.55,
        2.32,
        "compiled (Numba), one call from output row to output row",
        ha="center",
        fontsize=8.5,
        style="italic",
    )
    _box(axes, 0.0, 4.1, "deck", ".xml, .adm", _PYTHON)
    _box(axes, 2.4, 4.1, "Model", "mbsim/reader, model", _PYTHON)
    _box(axes, 4.8, 4.1, "arrays", "mbsim/compile_model, arrays", _PYTHON)
    _box(axes, 0.0, 1.3, "integrator", "mbsim/integrators", "white")
    _box(
        axes,
        3.1,
        1.3,
        "dynamics",
        "kinematics, contact, forces,\nconstraints, accelerations",
        "white",
    )
    _box(axes, 6.1, 1.3, "parts", "laws, joints, pairs, forces,\nexpressions", "white")
    _box(axes, 0.0, -0.1, "results", ".h5, .csv, .log", _PYTHON)
    _box(axes, 2.4, -0.1, "plot, info, request", "mbsim/results, cli", _PYTHON)
    _box(axes, 6.1, -0.1, "FCL, subroutines", "mbsim/geometry, plugins", _PYTHON)
    _arrow(axes, (0.95, 4.1), (1.45, 4.1))
    _arrow(axes, (3.35, 4.1), (3.85, 4.1))
    _arrow(axes, (4.8, 3.7), (3.5, 1.7))
    axes.text(4.6, 3.05, "mbsim/run: the loop,\nsettings, checkpoints", fontsize=7.5)
    _arrow(axes, (0.95, 1.4), (2.15, 1.4), "t, y", 0.12)
    _arrow(axes, (2.15, 1.2), (0.95, 1.2), "dy/dt", -0.13)
    _arrow(axes, (4.05, 1.4), (5.15, 1.4), "call", 0.12)
    _arrow(axes, (5.15, 1.2), (4.05, 1.2), "force", -0.13)
    _arrow(axes, (0.0, 0.9), (0.0, 0.3), "")
    _arrow(axes, (0.95, -0.1), (1.45, -0.1))
    _arrow(axes, (6.0, 0.3), (6.0, 0.9))
    _arrow(axes, (6.2, 0.9), (6.2, 0.3))
    axes.text(6.35, 0.62, "where asked", fontsize=7.5, va="center")

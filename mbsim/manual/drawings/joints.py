"""Sketches of the joints: J in grey, I in blue, free motions as arrows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mbsim.joints.catalog import JOINTS
from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float, float]
GROUND, MOVES, FREE = "0.55", "C0", "C1"
#: Unit vectors and two directions across each of them.
_AXES: dict[str, tuple[Point, Point, Point]] = {
    "x": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "y": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "z": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}


def flat(p: Point) -> tuple[float, float]:
    """Return where a point is on paper: z goes up, x to the right and towards us."""
    x, y, z = p
    return 0.9 * y + 0.45 * -x, z - 0.35 * x


def line(axes: Axes, points: Sequence[Point], **look: Any) -> None:
    """Draw a polygon of points in space."""
    xs, ys = zip(*map(flat, points), strict=True)
    axes.plot(xs, ys, **{"solid_capstyle": "round", "linewidth": 1.4, **look})


def along(axis: str, p: Point, by: float) -> Point:
    """Return a point so far along an axis."""
    e = _AXES[axis][0]
    return p[0] + by * e[0], p[1] + by * e[1], p[2] + by * e[2]


def arc(axis: str, p: Point, r: float, begin: float = 0.0, end: float = 360.0) -> list[Point]:
    """Return points of an arc about an axis through p; angles in degrees."""
    _, u, v = _AXES[axis]
    count = max(5, int(abs(end - begin) / 12))
    made = []
    for k in range(count + 1):
        angle = math.radians(begin + (end - begin) * k / count)
        c, s = r * math.cos(angle), r * math.sin(angle)
        made.append(
            (p[0] + c * u[0] + s * v[0], p[1] + c * u[1] + s * v[1], p[2] + c * u[2] + s * v[2])
        )
    return made


def tube(axes: Axes, axis: str, p: Point, r: float, length: float, color: str) -> None:
    """Draw a cylinder that begins at p."""
    line(axes, arc(axis, p, r), color=color)
    line(axes, arc(axis, along(axis, p, length), r), color=color)
    for angle in (125.0, 305.0):
        side = arc(axis, p, r, angle, angle + 1.0)[0]
        line(axes, [side, along(axis, side, length)], color=color)


def box(axes: Axes, p: Point, half: Point, color: str) -> None:
    """Draw the edges of a box."""
    signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    corners = {
        s: (p[0] + s[0] * half[0], p[1] + s[1] * half[1], p[2] + s[2] * half[2]) for s in signs
    }
    for s in signs:
        for other in ((1, s[1], s[2]), (s[0], 1, s[2]), (s[0], s[1], 1)):
            if other != s:
                line(axes, [corners[s], corners[other]], color=color, linewidth=1.0)


def ball(axes: Axes, p: Point, r: float, color: str) -> None:
    """Draw a filled ball."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle(flat(p), r, facecolor=color, edgecolor=color, alpha=0.8, zorder=3))


def _arrow(axes: Axes, points: Sequence[Point]) -> None:
    line(axes, points, color=FREE, linewidth=1.6)
    for tip, before in ((points[-1], points[-2]), (points[0], points[1])):
        axes.annotate(
            "", xy=flat(tip), xytext=flat(before),
            arrowprops={"arrowstyle": "-|>", "color": FREE, "shrinkA": 0, "shrinkB": 0, "lw": 1.2},
        )  # fmt: skip


def slides(axes: Axes, axis: str, p: Point, by: float = 0.35) -> None:
    """Draw that I slides along an axis."""
    _arrow(axes, [along(axis, p, by * (k / 2.0 - 1.0)) for k in range(5)])


def turns(axes: Axes, axis: str, p: Point, r: float = 0.35) -> None:
    """Draw that I turns about an axis."""
    _arrow(axes, arc(axis, p, r, -40.0, 160.0))


def _axis(axes: Axes, axis: str = "z", p: Point = (0.0, 0.0, 0.0), r: float = 1.0) -> None:
    line(axes, [along(axis, p, -r), along(axis, p, r)], color="0.3", linewidth=0.7, dashes=(8, 3))


def _rod(axes: Axes, axis: str = "z", r: float = 0.95) -> None:
    line(axes, [along(axis, (0.0, 0.0, 0.0), -r), along(axis, (0.0, 0.0, 0.0), r)],
         color=MOVES, linewidth=5, alpha=0.8)  # fmt: skip


def _plane(axes: Axes) -> None:
    corners = [(-0.8, -0.8, 0.0), (-0.8, 0.8, 0.0), (0.8, 0.8, 0.0), (0.8, -0.8, 0.0)]
    line(axes, [*corners, corners[0]], color=GROUND)


def _triads(axes: Axes) -> None:
    """Draw axes of J and, aside, of I, which are not held together."""
    for p, color in (((0.5, -0.7, -0.5), GROUND), ((-0.3, 0.35, 0.1), MOVES)):
        for axis in "xyz":
            line(axes, [p, along(axis, p, 0.6)], color=color)
            axes.annotate(axis, flat(along(axis, p, 0.72)), color=color, fontsize=7, ha="center",
                          va="center")  # fmt: skip


def _revolute(axes: Axes) -> None:
    _axis(axes)
    tube(axes, "z", (0.0, 0.0, -0.35), 0.3, 0.7, GROUND)
    _rod(axes, r=0.6)
    for z in (-0.42, 0.42):
        line(axes, arc("z", (0.0, 0.0, z), 0.2), color=MOVES, linewidth=2.5)
    turns(axes, "z", (0.0, 0.0, 0.75))


def _cylindrical(axes: Axes) -> None:
    _axis(axes)
    tube(axes, "z", (0.0, 0.0, -0.35), 0.3, 0.7, GROUND)
    _rod(axes, r=0.8)
    turns(axes, "z", (0.0, 0.0, 0.6))
    slides(axes, "z", (0.0, 0.65, 0.0))


def _translational(axes: Axes) -> None:
    _axis(axes)
    box(axes, (0.0, 0.0, 0.0), (0.3, 0.3, 0.35), GROUND)
    box(axes, (0.0, 0.0, 0.0), (0.15, 0.15, 0.8), MOVES)
    slides(axes, "z", (0.0, 0.65, 0.0))


def _screw(axes: Axes) -> None:
    _axis(axes)
    tube(axes, "z", (0.0, 0.0, -0.3), 0.32, 0.6, GROUND)
    thread = [
        (p[0], p[1], -0.85 + 1.7 * k / 84.0)
        for k, p in enumerate(q for _ in range(6) for q in arc("z", (0.0, 0.0, 0.0), 0.16)[:14])
    ]
    line(axes, thread, color=MOVES, linewidth=1.2)
    turns(axes, "z", (0.0, 0.0, 0.75))
    slides(axes, "z", (0.0, 0.65, 0.0))


def _spherical(axes: Axes) -> None:
    line(axes, arc("x", (0.0, 0.0, 0.0), 0.42, 150.0, 390.0), color=GROUND, linewidth=3)
    ball(axes, (0.0, 0.0, 0.0), 0.3, MOVES)
    line(axes, [(0.0, 0.0, 0.25), (0.0, 0.0, 0.9)], color=MOVES, linewidth=4)
    turns(axes, "z", (0.0, 0.0, 0.75), 0.3)
    turns(axes, "x", (0.0, 0.0, 0.0), 0.62)


def _cross(axes: Axes, bent: bool) -> None:
    line(axes, [(0.0, -0.9, 0.0), (0.0, -0.3, 0.0)], color=GROUND, linewidth=4)
    line(axes, [(0.0, 0.3, 0.0), (0.0, 0.8, 0.35 if bent else 0.0)], color=MOVES, linewidth=4)
    line(axes, [(0.0, -0.3, 0.35), (0.0, -0.3, -0.35)], color=GROUND)
    line(axes, [(0.0, -0.3, 0.35), (0.0, 0.0, 0.35)], color=GROUND)
    line(axes, [(0.0, -0.3, -0.35), (0.0, 0.0, -0.35)], color=GROUND)
    line(axes, [(0.0, 0.0, -0.4), (0.0, 0.0, 0.4)], color="0.2", linewidth=2.5)
    line(axes, [(-0.45, 0.0, 0.0), (0.45, 0.0, 0.0)], color="0.2", linewidth=2.5)
    line(axes, [(-0.45, 0.0, 0.0), (-0.45, 0.3, 0.0), (0.45, 0.3, 0.0), (0.45, 0.0, 0.0)],
         color=MOVES)  # fmt: skip


def _universal(axes: Axes) -> None:
    _cross(axes, True)
    turns(axes, "z", (0.0, 0.0, 0.62), 0.25)
    turns(axes, "x", (0.6, 0.0, 0.0), 0.25)


def _hooke(axes: Axes) -> None:
    _cross(axes, True)
    turns(axes, "y", (0.0, -0.65, 0.0), 0.28)
    turns(axes, "y", (0.0, 0.6, 0.26), 0.28)


def _constant_velocity(axes: Axes) -> None:
    line(axes, [(0.0, -0.95, -0.15), (0.0, -0.25, 0.0)], color=GROUND, linewidth=4)
    line(axes, [(0.0, 0.25, 0.0), (0.0, 0.9, 0.4)], color=MOVES, linewidth=4)
    line(axes, arc("x", (0.0, 0.0, 0.0), 0.33, 130.0, 310.0), color=GROUND, linewidth=3)
    ball(axes, (0.0, 0.0, 0.0), 0.22, MOVES)
    turns(axes, "y", (0.0, -0.65, -0.1), 0.28)
    turns(axes, "y", (0.0, 0.62, 0.25), 0.28)


def _planar(axes: Axes) -> None:
    _plane(axes)
    box(axes, (0.0, 0.0, 0.15), (0.25, 0.25, 0.15), MOVES)
    slides(axes, "x", (0.0, -0.55, 0.0), 0.3)
    slides(axes, "y", (0.55, 0.0, 0.0), 0.3)
    turns(axes, "z", (0.0, 0.0, 0.6))


def _inplane(axes: Axes) -> None:
    _plane(axes)
    ball(axes, (0.0, 0.0, 0.0), 0.12, MOVES)
    slides(axes, "x", (0.0, -0.4, 0.0), 0.3)
    slides(axes, "y", (0.4, 0.1, 0.0), 0.3)
    for axis in "zx":
        turns(axes, axis, (0.0, 0.0, 0.0), 0.3)


def _inline(axes: Axes) -> None:
    line(axes, [(0.0, 0.0, -0.95), (0.0, 0.0, 0.95)], color=GROUND, linewidth=3)
    ball(axes, (0.0, 0.0, 0.0), 0.18, MOVES)
    slides(axes, "z", (0.0, 0.6, 0.0))
    for axis in "zx":
        turns(axes, axis, (0.0, 0.0, 0.0), 0.36)


def _fixed(axes: Axes) -> None:
    box(axes, (0.0, -0.35, 0.0), (0.3, 0.35, 0.3), GROUND)
    box(axes, (0.0, 0.35, 0.0), (0.3, 0.35, 0.3), MOVES)


def _distance(axes: Axes) -> None:
    line(axes, [(0.0, -0.7, -0.35), (0.0, 0.7, 0.35)], color="0.2", linewidth=2)
    ball(axes, (0.0, -0.7, -0.35), 0.13, GROUND)
    ball(axes, (0.0, 0.7, 0.35), 0.13, MOVES)
    turns(axes, "x", (0.0, -0.7, -0.35), 0.4)
    turns(axes, "x", (0.0, 0.7, 0.35), 0.4)


def _rack_pinion(axes: Axes) -> None:
    line(axes, arc("x", (0.0, 0.0, 0.0), 0.45), color=MOVES, linewidth=2)
    teeth = [(0.0, -0.9 + 0.1 * k, -0.47 - 0.1 * (k % 2)) for k in range(19)]
    line(axes, teeth, color=GROUND)
    turns(axes, "x", (0.0, 0.0, 0.0), 0.3)
    slides(axes, "y", (0.0, 0.0, -0.75), 0.4)


def _orientation(axes: Axes) -> None:
    _triads(axes)
    for axis, p in (("x", (0.0, 0.9, -0.5)), ("y", (0.0, 0.5, -0.75)), ("z", (0.0, -0.3, 0.45))):
        slides(axes, axis, p, 0.22)


def _parallel(axes: Axes) -> None:
    _axis(axes, "z", (0.0, -0.5, 0.0), 0.8)
    _axis(axes, "z", (0.0, 0.4, 0.0), 0.8)
    line(axes, [(0.0, -0.5, -0.4), (0.0, -0.5, 0.4)], color=GROUND, linewidth=4)
    line(axes, [(0.0, 0.4, -0.4), (0.0, 0.4, 0.4)], color=MOVES, linewidth=4)
    turns(axes, "z", (0.0, 0.4, 0.6), 0.25)
    slides(axes, "y", (0.0, 0.0, -0.65), 0.25)


def _perpendicular(axes: Axes) -> None:
    line(axes, [(0.0, -0.5, -0.6), (0.0, -0.5, 0.6)], color=GROUND, linewidth=4)
    line(axes, [(0.0, -0.1, 0.1), (0.0, 0.9, 0.1)], color=MOVES, linewidth=4)
    turns(axes, "y", (0.0, 0.7, 0.1), 0.25)
    turns(axes, "z", (0.0, -0.5, 0.7), 0.25)


def _free(axes: Axes) -> None:
    box(axes, (0.2, -0.45, -0.3), (0.25, 0.25, 0.25), GROUND)
    box(axes, (-0.2, 0.45, 0.3), (0.25, 0.25, 0.25), MOVES)


_SKETCHES: dict[str, Callable[[Axes], None]] = {
    "FIXED": _fixed,
    "REVOLUTE": _revolute,
    "TRANSLATIONAL": _translational,
    "CYLINDRICAL": _cylindrical,
    "SPHERICAL": _spherical,
    "PLANAR": _planar,
    "SCREW": _screw,
    "RACK_PINION": _rack_pinion,
    "UNIVERSAL": _universal,
    "HOOKE": _hooke,
    "CONSTANT_VELOCITY": _constant_velocity,
    "DISTANCE": _distance,
    "INLINE": _inline,
    "INPLANE": _inplane,
    "ORIENTATION": _orientation,
    "PARALLEL_AXES": _parallel,
    "PERPENDICULAR": _perpendicular,
    "FREE": _free,
}


def _draw(figure: Figure, names: Sequence[str]) -> None:
    """Draw nine joints."""
    for axes, name in zip(figure.subplots(3, 3).flat, names, strict=True):
        _SKETCHES[name](axes)
        axes.set_title(name, fontsize=8)
    for axes in figure.axes:
        axes.set(xlim=(-1.15, 1.15), ylim=(-1.15, 1.15), aspect="equal")
        axes.set_axis_off()


@picture("joints-1.svg", width=6.4, height=6.0)
def first(figure: Figure) -> None:
    """Draw the first half of the joints; each of the registry has its sketch."""
    assert set(_SKETCHES) == set(JOINTS)
    _draw(figure, list(_SKETCHES)[:9])


@picture("joints-2.svg", width=6.4, height=6.0)
def second(figure: Figure) -> None:
    """Draw the other half of the joints."""
    _draw(figure, list(_SKETCHES)[9:])

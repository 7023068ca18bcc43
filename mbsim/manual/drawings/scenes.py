"""Pictures of decks with meshes: the surfaces of all bodies at a few times of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import mbsim
from mbsim.manual.drawings import runs
from mbsim.manual.pictures import picture
from mbsim.model.elements import Array, Graphic, Model
from mbsim.model.placement import place
from mbsim.model.tessellation import triangles_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Dots per inch of the surfaces; titles are drawn as lines.
_DPI = 110
#: Direction of the light, from the viewer's upper left.
_LIGHT = np.array([-0.4, 0.5, 0.77])


def _view(turn: float, tilt: float) -> Array:
    """Return the axes of a view by rows: right, up, towards the viewer; angles in degrees."""
    a, b = np.radians([turn, tilt])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    front = np.array([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])
    return np.stack([right, np.cross(front, right), front])


def _rotation(q: Array) -> Array:
    """Return the rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = q
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R: Array = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return R


def _square(reach: float) -> Array:
    """Return a plane's square as triangles (2, 3, 3)."""
    p = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    return p[[[0, 1, 2], [0, 2, 3]]]


class _Scene:
    """A deck, its run, and where the triangles of its graphics are in their bodies."""

    def __init__(self, deck: str, reach: float, **settings: Any) -> None:
        self.model: Model = mbsim.read_model(runs.MODELS / deck)
        self.run = mbsim.simulate(self.model, **settings)
        self.reach = reach
        self.places = place(self.model)

    def triangles(self, graphic: Graphic, row: int) -> Array:
        """Return the triangles of a graphic at a row, global, shape (m, 3, 3) [L]."""
        marker = self.places.markers[graphic.marker_id]
        if graphic.shape == "PLANE":
            corners = marker.p + _square(self.reach) @ marker.R.T
            corners[:, :, 2] = np.maximum(corners[:, :, 2], 0.0)
        else:
            vertices, faces = triangles_of(graphic)
            corners = marker.p + (vertices + np.array(graphic.offset))[faces] @ marker.R.T
        body = self.model.markers[graphic.marker_id].body_id
        if body not in self.places.bodies:
            return np.asarray(corners)
        start = self.places.bodies[body]
        turned = _rotation(self.run[f"bodies/{body}/quaternion"][row]) @ start.R.T
        moved: Array = self.run[f"bodies/{body}/position"][row] + (corners - start.p) @ turned.T
        return moved

    def draw(self, ax: Axes, row: int, view: Array, clip: Array | None = None) -> None:
        """Draw all triangles that face the viewer, the farthest first.

        What lies beyond the plane through the origin with the normal `clip` is left out, so that
        one sees into a part.
        """
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgb

        ax.set_aspect("equal")
        ax.set_axis_off()
        shown, shades = [], []
        for k, graphic in enumerate(self.model.graphics.values()):
            corners = self.triangles(graphic, row)
            if clip is not None:
                corners = corners[(corners @ clip).max(axis=1) < 1e-6]
            seen = corners @ view.T
            normal = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
            normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
            ground = self.model.markers[graphic.marker_id].body_id not in self.places.bodies
            colour = np.array(to_rgb("0.8" if ground else f"C{k % 10}"))
            # with the near half cut away, the inside of the far one shows
            front = (normal[:, 2] > 0.0) | (clip is not None)
            # a few shades only: the picture stays small
            light = 0.45 + 0.05 * np.round(11.0 * np.clip(np.abs(normal @ _LIGHT), 0.0, 1.0))
            if graphic.shape == "PLANE" or (ground and clip is not None):
                # walls stand behind what they hold, and so does the far half of a hole
                seen = seen - np.array([0.0, 0.0, 1e3])
                front |= not ground
            shown.append(seen[front])
            shades.append(np.clip(light[front, None] * colour, 0.0, 1.0))
        corners, colours = np.concatenate(shown), np.concatenate(shades)
        order = np.argsort(corners[:, :, 2].mean(axis=1))
        corners, colours = corners[order], colours[order]
        ax.add_collection(
            PolyCollection(
                list(corners[:, :, :2]),
                facecolors=colours,
                edgecolors=colours,
                linewidths=0.4,
                antialiaseds=False,
                rasterized=True,
            )
        )
        ax.autoscale_view()


def _panels(
    figure: Figure,
    scene: _Scene,
    times: Sequence[float],
    view: Array,
    clip: Array | None = None,
) -> None:
    """Draw a scene at some times beside each other."""
    figure.set_dpi(_DPI)
    time = scene.run["time"]
    panels = figure.subplots(1, len(times), squeeze=False)[0]
    for ax, t in zip(panels, times, strict=True):
        row = int(np.argmin(np.abs(time - t)))
        scene.draw(ax, row, view, clip)
        ax.set_title(f"{time[row]:.3g} s")


@picture("scene-bolt.svg", width=5.0, height=2.6)
def bolt(figure: Figure) -> None:
    """The bolt in its hole, cut open, at the begin and at rest."""
    _panels(
        figure, _Scene("bolt_on_plate.xml", 0.0), (0.0, 0.3), _view(-70.0, 20.0),
        clip=np.array([0.0, -1.0, 0.0]),
    )  # fmt: skip


@picture("scene-ratchet.svg", height=2.6)
def ratchet(figure: Figure) -> None:
    """The ratchet's wheel goes over teeth, comes back, is held."""
    _panels(figure, _Scene("ratchet.xml", 0.0), (0.0, 0.2, 1.0), _view(-80.0, 60.0))


@picture("scene-gears.svg", height=2.4)
def gears(figure: Figure) -> None:
    """The gears over one mesh cycle: from tooth to tooth of the first."""
    scene = _Scene("gear_pair.xml", 0.0, end_time=0.01)
    _panels(figure, scene, (0.0, 0.005, 0.01), _view(-90.0, 75.0))


@picture("scene-bowl.svg", height=2.6)
def bowl(figure: Figure) -> None:
    """Balls fall into the bowl."""
    _panels(figure, _Scene("balls_in_bowl.xml", 0.0), (0.0, 0.2, 1.0), _view(-60.0, 40.0))


@picture("scene-cam.svg", height=2.4)
def cam(figure: Figure) -> None:
    """The cam lifts its flat follower."""
    _panels(figure, _Scene("cam_from_stl.xml", 30.0), (0.1, 0.2, 0.3), _view(-75.0, 65.0))


@picture("scene-pile.svg", height=2.8)
def pile(figure: Figure) -> None:
    """Parts of six shapes fall into a bin."""
    _panels(figure, _Scene("mixed_pile.xml", 45.0), (0.0, 0.1, 0.55), _view(-60.0, 45.0))

"""Shapes as packed triangles, for the pairs that are measured as patches of surfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np

from mbsim.compile_model.kept_surfaces import kept_surface
from mbsim.compile_model.pairing import Plans, shape_class
from mbsim.model.elements import Array, Graphic, Model
from mbsim.model.surface import (
    AT_TRIANGLES,
    CORNER_NORMAL,
    DEPTH,
    ORDER,
    TRIANGLE,
    TRIANGLES,
    UNIT,
)
from mbsim.model.tessellation import triangles_of

#: Sides of pairs that are measured as triangles.
_OF_TRIANGLES = {"SURFACE", "FIELD"}
#: A layer reaches this part of half of a wall's thickness, by `model.surface_layer`; how many
#: in a hundred of its depths are taken for faults of the mesh rather than for walls.
OF_HALF, THIN = 0.72, 2.0
#: Ways in at least, and triangles at most that these are tried on.
LEAST_WAYS, MOST_CROSSINGS = 16, 1_000_000


class Need(IntEnum):
    """What of a mesh the pairs of a graphic need; each one has those before it."""

    TRIANGLES = 0
    WALL = 1  # how thick its walls are
    LAYER = 2


def needed_as_triangles(model: Model, plans: Plans) -> dict[int, Need]:
    """Return the graphics (ids) that a pair needs as triangles, and what of them.

    On a plane and under a sphere the layer has no part; nothing passes through a plane.
    """
    found: dict[int, Need] = {}

    def note(pair: str, first: Sequence[int], second: Sequence[int]) -> None:
        need = Need.LAYER
        if "SPHERE" in pair or "PLANE" in pair:
            need = Need.WALL if "SPHERE" in pair else Need.TRIANGLES
        for side, ids in zip(pair.split("-"), (first, second), strict=True):
            if side in _OF_TRIANGLES:
                for id in ids:
                    found[id] = max(found.get(id, Need.TRIANGLES), need)

    for plan in plans.pairs:
        if _OF_TRIANGLES & set(plan.kind.closed_form.split("-")):
            note(plan.kind.closed_form, [plan.graphic_i], [plan.graphic_j])
    for contact_set in plans.broadphase:
        # by class: pairs of graphics are too many
        of_i, of_j = _by_class(model, contact_set.i), _by_class(model, contact_set.j)
        for classes, kind in contact_set.kinds.items():
            if _OF_TRIANGLES & set(kind.closed_form.split("-")):
                i, j = of_i.get(classes[0], []), of_j.get(classes[1], [])
                note(kind.closed_form, *((j, i) if kind.swapped else (i, j)))
    return found


def _by_class(model: Model, ids: Sequence[int]) -> dict[str, list[int]]:
    """Return graphics by what they have in common."""
    found: dict[str, list[int]] = {}
    for id in ids:
        found.setdefault(shape_class(model.graphics[id]), []).append(id)
    return found


def packed(graphic: Graphic, layered: bool) -> Array:
    """Return a graphic as a packed surface (`model.surface`), to be written to."""
    found: Array = kept_surface(*triangles_of(graphic), layered).copy()
    return found


def thickness(surface: Array, need: Need) -> float:
    """Return half of how thin a packed surface is where it is thin; inf where none asks.

    With a layer it is known by its depths, else by ways in from some triangles' middles.
    """
    count = int(surface[TRIANGLES])
    table = surface[int(surface[AT_TRIANGLES]) :][: count * TRIANGLE].reshape(count, TRIANGLE)
    if need == Need.LAYER:
        depth = table[:, DEPTH:ORDER]
        depth = depth[depth > 0.0]
        return float(np.percentile(depth, THIN)) / OF_HALF if len(depth) else math.inf
    if need == Need.TRIANGLES:
        return math.inf
    from mbsim.geometry.mesh.ball import SQUARE

    corners, unit = table[:, :9].reshape(count, 3, 3), table[:, UNIT:CORNER_NORMAL]
    ways = min(count, max(LEAST_WAYS, MOST_CROSSINGS // count))
    begins = np.linspace(0, count - 1, ways).astype(np.int64)
    on_plane, _, _ = corners.swapaxes(0, 1)
    least = math.inf
    for p, n in zip(corners[begins].mean(axis=1), unit[begins], strict=True):
        slope = -unit @ n
        out = np.flatnonzero(slope > SQUARE)
        way = ((on_plane[out] - p) * unit[out]).sum(axis=1) / slope[out]
        # those that are farther than what was found are not looked at
        near = (way > 0.0) & (way < least)
        out, way = out[near], way[near]
        first, second, third = corners[out].swapaxes(0, 1)
        x = p - way[:, None] * n
        hit = np.ones(len(way), dtype=bool)
        for begin, end in ((first, second), (second, third), (third, first)):
            hit &= (np.cross(end - begin, x - begin) * unit[out]).sum(axis=1) >= 0.0
        least = min(least, float(way[hit].min(initial=math.inf)))
    return 0.5 * least


def packed_surfaces(
    graphics: Mapping[int, Graphic], needed: Mapping[int, Need]
) -> tuple[Array, dict[int, int]]:
    """Return the packed surfaces of graphics behind each other, and where each one begins.

    Equal shapes have one in common.
    """
    parts: list[Array] = []
    places: dict[tuple[str, tuple[float, ...], bool], int] = {}
    begins, length = {}, 0
    for id, need in needed.items():
        layered = need == Need.LAYER
        key = (shape_class(graphics[id]), graphics[id].size, layered)
        if key not in places:
            parts.append(packed(graphics[id], layered))
            places[key] = length
            length += len(parts[-1])
        begins[id] = places[key]
    return np.concatenate([*parts, np.zeros(0)]), begins

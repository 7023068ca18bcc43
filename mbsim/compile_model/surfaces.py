"""Shapes as packed triangles, for the pairs that are measured as patches of surfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from mbsim.compile_model.pairing import Plans, shape_class
from mbsim.model.elements import Array, Graphic, Model
from mbsim.model.flat_parts import fewer_triangles
from mbsim.model.surface import AT_TRIANGLES, DEPTH, ORDER, TRIANGLE, TRIANGLES, pack
from mbsim.model.tessellation import triangles_of

#: Sides of pairs that are measured as triangles.
_OF_TRIANGLES = {"SURFACE", "FIELD"}
#: A layer reaches this part of half of a wall's thickness, by `model.surface_layer`; how many
#: in a hundred of its depths are taken for faults of the mesh rather than for walls.
OF_HALF, THIN = 0.72, 2.0


def needed_as_triangles(model: Model, plans: Plans) -> dict[int, bool]:
    """Return the graphics (ids) that a pair needs as triangles, and whether with their layer.

    On a plane and under a sphere the layer has no part.
    """
    found: dict[int, bool] = {}

    def note(pair: str, first: int, second: int) -> None:
        layered = pair in ("SURFACE-SURFACE", "FIELD-FIELD")
        for side, id in zip(pair.split("-"), (first, second), strict=True):
            if side in _OF_TRIANGLES:
                found[id] = found.get(id, False) or layered

    for plan in plans.pairs:
        if _OF_TRIANGLES & set(plan.kind.closed_form.split("-")):
            note(plan.kind.closed_form, plan.graphic_i, plan.graphic_j)
    for contact_set in plans.broadphase:
        for i in contact_set.i:
            for j in contact_set.j:
                classes = shape_class(model.graphics[i]), shape_class(model.graphics[j])
                kind = contact_set.kinds.get(classes)
                if kind is not None and _OF_TRIANGLES & set(kind.closed_form.split("-")):
                    note(kind.closed_form, *((j, i) if kind.swapped else (i, j)))
    return found


def packed(graphic: Graphic, layered: bool) -> Array:
    """Return a graphic as a packed surface (`model.surface`)."""
    vertices, faces = fewer_triangles(*triangles_of(graphic))
    if not layered:
        return pack(vertices, faces)
    from mbsim.model.surface_layer import layer

    return pack(vertices, faces, *layer(vertices, faces))


def thickness(surface: Array) -> float:
    """Return half of how thin a packed surface is where its layer is thin; inf without a layer."""
    count = int(surface[TRIANGLES])
    table = surface[int(surface[AT_TRIANGLES]) :][: count * TRIANGLE].reshape(count, TRIANGLE)
    depth = table[:, DEPTH:ORDER]
    depth = depth[depth > 0.0]
    return float(np.percentile(depth, THIN)) / OF_HALF if len(depth) else math.inf


def packed_surfaces(
    graphics: Mapping[int, Graphic], needed: Mapping[int, bool]
) -> tuple[Array, dict[int, int]]:
    """Return the packed surfaces of graphics behind each other, and where each one begins.

    Equal shapes have one in common.
    """
    parts: list[Array] = []
    places: dict[tuple[str, tuple[float, ...], bool], int] = {}
    begins, length = {}, 0
    for id, layered in needed.items():
        key = (shape_class(graphics[id]), graphics[id].size, layered)
        if key not in places:
            parts.append(packed(graphics[id], layered))
            places[key] = length
            length += len(parts[-1])
        begins[id] = places[key]
    return np.concatenate([*parts, np.zeros(0)]), begins

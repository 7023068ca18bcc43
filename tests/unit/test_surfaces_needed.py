"""Which graphics a model needs as triangles, and what it costs to find out."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from helpers.decks import GRAVITY, GROUND, write_deck
from helpers.pile_decks import sets, shape_graphic, solid
from mbsim import read_model
from mbsim.compile_model import surfaces
from mbsim.compile_model.pairing import plan_pairs
from mbsim.compile_model.surfaces import Need
from mbsim.model.elements import Graphic

LAW = {"stiffness": 1e5, "exponent": 1, "damping": 100.0, "dmax": 1e-4}


def needed(folder: Path, shapes: list[str], **law: object) -> dict[int, Need]:
    """Return what is needed as triangles where bodies of those shapes lie beside each other."""
    text = GROUND
    ids = []
    for k, shape in enumerate(shapes):
        place = (0.5 * (k % 20), 0.5 * (k // 20), 0.2)
        text += solid(2 + k, partial(shape_graphic, shape, size=0.1), place)
        ids.append(100 * (2 + k))
    text += sets(ids, [100], id=301, **LAW, **law) + sets(ids, ids, id=302, **LAW, **law)
    model = read_model(write_deck(folder, text + GRAVITY))
    return surfaces.needed_as_triangles(model, plan_pairs(model))


def test_meshes_among_boxes_have_a_layer_where_both_are_triangles(tmp_path: Path) -> None:
    shapes = ["MESH", "BOX", "MESH"]
    found = needed(tmp_path, shapes, contact_depth="FIELD")
    assert found == {200: Need.LAYER, 300: Need.LAYER, 400: Need.LAYER}
    assert needed(tmp_path, shapes[1:2] * 3) == {}


def test_the_cost_grows_with_graphics_not_with_pairs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0
    of_class = surfaces.shape_class

    def counted(graphic: Graphic) -> str:
        nonlocal calls
        calls += 1
        return of_class(graphic)

    monkeypatch.setattr(surfaces, "shape_class", counted)
    for count in (40, 80):
        calls = 0
        assert needed(tmp_path, ["SPHERE"] * count) == {}
        # two contacts, of which one has all twice and one all with the plane
        assert 0 < calls <= 3 * count + 1

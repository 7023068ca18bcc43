"""Involute gears as meshes: transmission error against the closed form, mean ratio of speeds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsim
from helpers.decks import run_model, write_deck
from helpers.folders import MODELS
from helpers.mesh_parts import gear
from helpers.pairs import frame, turned
from helpers.surfaces import Meshed, call, incidents, mesh_graphic, wrench
from mbsim.model.flat_parts import fewer_triangles
from mbsim.model.mesh import merge_vertices

MODULE, WIDTH, BACKLASH, STIFFNESS, TORQUE = 2.0, 10.0, 0.02, 1e4, 1e3
PITCH_ANGLE = 2.0 * np.pi / 20
#: Half an angle of a tooth: a space of the wheel faces a tooth of the pinion.
FACING = np.pi / 30
ON_Z = (0.0, 0.0, 1.0)


def part(teeth, segments):
    return merge_vertices(*gear(teeth, MODULE, WIDTH, segments + 1, BACKLASH))


def incident_rows(pair, angle, more):
    """Return the rows of wheel on pinion; `more` [rad] is what the wheel is ahead of its ratio."""
    pinion, wheel = pair
    return call(
        "SURFACE-SURFACE",
        frame([50.0, 0.0, 0.0], turned(ON_Z, FACING - 2.0 / 3.0 * angle + more)),
        wheel.size,
        frame(np.zeros(3), turned(ON_Z, angle)),
        pinion.size,
    )


def ahead_under_load(pair, angle):
    """Return what the wheel is ahead [rad] where the flanks carry the torque."""

    def rest(more):
        rows = incident_rows(pair, angle, more)
        return STIFFNESS * wrench(rows, step=2, about=(50.0, 0.0, 0.0))[5] + TORQUE

    return brentq(rest, 1.2e-3, 3e-3, xtol=1e-13)


def test_the_transmission_error_is_that_of_springs_and_of_second_order():
    """One pair of flanks gives T/(k r_b^2), two give half of that; facets add what falls by 4."""
    # the last twelfth of the cycle, where a tip comes in touch, is left out
    angles = PITCH_ANGLE * (np.arange(11) + 0.4) / 12
    found = np.array(
        [
            [ahead_under_load(pair, angle) for angle in angles]
            for pair in [
                [Meshed(*fewer_triangles(*part(z, n))) for z in (20, 30)] for n in (8, 16, 32)
            ]
        ]
    )
    steps = np.sqrt((np.diff(found, axis=0) ** 2).mean(axis=1))
    assert 1.7 < np.log2(steps[0] / steps[1]) < 2.3
    base = 30.0 * np.cos(np.deg2rad(20.0))
    give = TORQUE / (STIFFNESS * base**2)
    many = np.round(give / (found[-1] - BACKLASH * MODULE / 30.0))
    assert set(many) == {1.0, 2.0}
    exact = BACKLASH * MODULE / 30.0 + give / many
    np.testing.assert_allclose(found[-1], exact, atol=2e-5)
    # where on a facet the flanks touch differs, so only their mean has no second order left
    left = (4.0 * found[2] - found[1]) / 3.0 - exact
    assert abs(left.mean()) < 2e-6


def test_gears_of_the_deck_start_apart():
    pair = [Meshed(*fewer_triangles(*part(*shape))) for shape in ((20, 59), (30, 39))]
    rows = incident_rows(pair, 0.0, 0.0)
    assert len(incidents(rows)[0]) == 0
    # both teeth are thinner: half of what they are together is on either side of the tooth
    assert -rows[0, 0] == pytest.approx(BACKLASH * MODULE * np.cos(np.deg2rad(20.0)), rel=0.2)


def ratio_error(results, cycles, skip):
    """Return by how much the mean ratio of speeds over whole mesh cycles is off, relatively."""
    t = results["time"]
    first, second = results["requests/1/F2"], results["requests/1/F3"]
    each = round(0.01 / (t[1] - t[0]))
    at = np.array([skip * each, (skip + cycles) * each])
    turns = np.diff(np.unwrap(first)[at])[0], np.diff(np.unwrap(second)[at])[0]
    assert turns[0] == pytest.approx(cycles * PITCH_ANGLE, rel=1e-9)
    return turns[1] / turns[0] * -1.5 - 1.0


@pytest.mark.slow
def test_the_mean_ratio_of_speeds_is_that_of_the_teeth():
    results = run_model("gear_pair.xml")
    assert results["contacts/301/penetration"][0] == 0.0
    assert abs(ratio_error(results, 4, 1)) < 1e-6
    # loaded one way, the same flanks touch all the time
    late = results["time"] > 0.005
    assert results["contacts/301/penetration"][late].min() > 0.0


def test_coarse_gears_turn_in_the_ratio_of_their_teeth(tmp_path):
    text = (MODELS / "gear_pair.xml").read_text(encoding="utf-8")
    for id, marker, teeth in ((200, 20, 20), (300, 30, 30)):
        line = f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}" file="gear{teeth}.stl"/>'
        assert line in text
        text = text.replace(line, mesh_graphic(id, marker, *part(teeth, 6)))
    body = text.split("<Model>")[1].split("</Model>")[0]
    path = write_deck(tmp_path, body, end_time=0.03, print_interval=0.0005)
    results = mbsim.simulate(mbsim.read_model(path))
    assert abs(ratio_error(results, 1, 2)) < 1e-5
    assert abs(ratio_error(results, 2, 1)) < 1e-4

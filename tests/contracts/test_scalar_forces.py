"""What every force by one displacement must keep: slopes, energy, sides, what it remembers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbsim.arrays import codes
from mbsim.forces.catalog import Acts, Scalar, Switched, of_form
from mbsim.forces.formula import Kept
from mbsim.laws.catalog import NORMAL_LAWS

#: Half of the difference of displacements and velocities.
STEP = 1e-5
KINDS = [kind.name for kind in of_form(Scalar, Switched)]
BRANCHED = [kind.name for kind in of_form(Switched)]
#: Attributes of kinds whose elements have a class of their own.
OWN = {"JOINTLIMIT": {"direction": "T", "lower": -0.4, "upper": 0.3}}
#: Both sides of all limits and sliders, apart from where one branch ends.
DISPLACEMENTS = (-1.1, -0.37, 0.01, 0.52, 1.3)
#: Before the first step, sticking, sliding either way.
MEMORIES = [Kept(math.nan, 0.0, 1.0), *(Kept(0.2, mode, 1.0) for mode in (0.0, 1.0, -1.0))]


def kind_of(name):
    """Return a kind by its name."""
    (kind,) = (kind for kind in of_form(Scalar, Switched) if kind.name == name)
    return kind


def values_of(kind, seed=0):
    """Return attributes of a kind: numbers from 0.5 to 2, or the first of its words."""
    rng = np.random.default_rng(seed)
    values = dict(OWN.get(kind.name, {}))
    for each in kind.parameters:
        number = None if each.optional else float(rng.uniform(0.5, 2.0))
        values[each.name] = each.words[0] if each.words else number
    assert not [finding for finding in kind.check(values) if not finding.warns]
    return values


def law(depth, rate):
    """Return what a normal law makes of a depth."""
    return NORMAL_LAWS["HUNT_CROSSLEY"].law(depth, rate, 30.0, 1.5, 0.2)


def given(kind, kept):
    """Return what the formula of a kind takes behind its constants."""
    return (kept, law) if isinstance(kind.form, Switched) else ()


def cases(name):
    """Yield kind, constants and memories that its formula is asked with."""
    kind = kind_of(name)
    for seed in range(3):
        par = np.array(kind.form.constants(values_of(kind, seed)))
        for kept in MEMORIES if getattr(kind.form, "commit", None) else MEMORIES[:1]:
            for x in DISPLACEMENTS:
                yield kind, par, kept, x


@pytest.mark.parametrize("name", KINDS)
def test_slopes_are_the_differences_of_the_force(name):
    for kind, par, kept, x in cases(name):
        if kind.form.slopes is None:
            continue
        rest = given(kind, kept)
        found = kind.form.slopes(x, 0.7, par, *rest)
        ends = [kind.form.force(x + s * STEP, 0.7, par, *rest)[0] for s in (1, -1)]
        faster = [kind.form.force(x, 0.7 + s * STEP, par, *rest)[0] for s in (1, -1)]
        # rounding over STEP
        assert found[0] == pytest.approx((ends[0] - ends[1]) / (2 * STEP), abs=1e-9)
        assert found[1] == pytest.approx((faster[0] - faster[1]) / (2 * STEP), abs=1e-9)


@pytest.mark.parametrize("name", KINDS)
def test_power_is_what_is_stored_and_lost(name):
    for kind, par, kept, x in cases(name):
        for rate in (-0.6, 0.8):
            rest = given(kind, kept)
            force, _, lost = kind.form.force(x, rate, par, *rest)
            ends = [kind.form.force(x + s * STEP * rate, rate, par, *rest)[1] for s in (1, -1)]
            gain = (ends[0] - ends[1]) / (2 * STEP)
            # the difference is off by STEP^2 times third derivatives below 100
            assert force * rate + gain + lost == pytest.approx(0.0, abs=2e-8)


@pytest.mark.parametrize("name", KINDS)
def test_what_does_not_move_loses_nothing(name):
    for kind, par, kept, x in cases(name):
        assert kind.form.force(x, 0.0, par, *given(kind, kept))[2] == 0.0


@pytest.mark.parametrize("name", BRANCHED)
def test_a_side_is_a_number_that_tells_branches(name):
    sides = set()
    for kind, par, kept, x in cases(name):
        near = {kind.form.side(x + shift, 0.5, par, kept, law) for shift in (-1e-9, 0.0, 1e-9)}
        assert len(near) == 1
        assert math.isfinite(min(near))
        sides |= near
    assert len(sides) > 1


@pytest.mark.parametrize("name", BRANCHED)
def test_what_is_remembered(name):
    for kind, par, kept, x in cases(name):
        if kind.form.commit is None:
            continue
        slider, mode, lost = kind.form.commit(x, 0.5, par, kept)
        assert math.isfinite(slider)
        assert mode in (-1.0, 0.0, 1.0)
        assert lost >= 0.0
        # frozen, the force goes on behind a step as it ended, but for what was lost at once
        before, stored, _ = kind.form.force(x, 0.5, par, kept, law)
        after, left, _ = kind.form.force(x, 0.5, par, Kept(slider, mode, 1.0), law)
        if mode == kept.mode:
            assert after == pytest.approx(before, abs=1e-12)
            assert left + lost == pytest.approx(stored, abs=1e-12)


@pytest.mark.parametrize("name", KINDS)
def test_where_it_acts(name):
    kind = kind_of(name)
    values = values_of(kind)
    words = {each.name: each.words for each in kind.parameters if each.words}
    for attribute, several in words.items():
        for word in several:
            acts = kind.form.acts(values | {attribute: word})
            assert isinstance(acts, Acts)
            assert acts.axis in range(3)
            # angles are followed only where a torque acts
            assert not acts.turns or acts.form == codes.AXIS_TORQUE

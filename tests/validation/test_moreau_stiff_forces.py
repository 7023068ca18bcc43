"""MOREAU with forces that are stiffer than its steps are short: they are implicit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text
from mbsim.bench.scenes import s13_quadruped

WEIGHT = 9.81
#: What writes a force between markers, by stiffness and damping.
Make = Callable[[int, int, float, float], str]


def spring(i: int, j: int, k: float, c: float) -> str:
    """Return a spring of no length between markers, with a damper."""
    return (
        f'<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="{i}" j_marker_id="{j}" '
        f'stiffness="{k}" damping="{c}" length="0.5"/>'
    )


def bushing(i: int, j: int, k: float, c: float) -> str:
    """Return a bushing that is stiff in all its directions."""
    names = {f"k{a}": k for a in "xyz"} | {f"c{a}": c for a in "xyz"}
    names |= {f"kt{a}": 0.1 * k for a in "xyz"} | {f"ct{a}": 0.1 * c for a in "xyz"}
    return f"<Force_Bushing {text.attributes(id=1, i_marker_id=i, j_marker_id=j, **names)}/>"


def by_expression(i: int, j: int, k: float, c: float) -> str:
    """Return the spring as an expression, along x of ground."""
    force = f"-{k}*(DX({i},{j})-0.5)-{c}*VX({i},{j})"
    names = text.attributes(
        id=1,
        type="ForceOnly",
        i_marker_id=i,
        j_floating_marker_id=12,
        ref_marker_id=10,
        fx_expression=force,
        fy_expression="0",
        fz_expression="0",
    )
    return f"<Force_Vector_TwoBody {names}/>"


def held(folder: Path, force: str, mu: float, h: float | None, end: float = 1.0) -> mbsim.Results:
    """Return a cube on the floor, 1 kg, half a metre and 0.1 m from what `force` holds it to."""
    parts = [
        decks.cube(2, 1.0, 0.2, (0.6, 0.0, 0.1)),
        text.marker(11, 1, (0.0, 0.0, 0.1)),
        text.marker(12, 1, (0.0, 0.0, 0.0)),
        text.contact(301, [200], [100], **decks.rubbed(mu)),
        text.gravity(),
        force,
    ]
    return mbsim.simulate(decks.model(folder, parts, end, h), integrator="MOREAU", tol=1e-4)


@pytest.mark.parametrize("h", [1e-2, 1e-3, None])
@pytest.mark.parametrize("make", [spring, by_expression])
@pytest.mark.parametrize(("k", "c"), [(1e7, 1e4), (1e9, 0.0), (10.0, 1e6)])
def test_a_block_comes_to_rest_however_stiff_what_holds_it(
    tmp_path: Path, make: Make, k: float, c: float, h: float | None
) -> None:
    """It stays within the stretch that friction holds, or creeps as the damper lets it.

    Steps that its own period is shorter than take the swing off it.
    """
    results = held(tmp_path, make(20, 11, k, c), 0.3, h)
    x, v = results["bodies/2/position"][:, 0], results["bodies/2/velocity"][-1]
    assert np.abs(x - 0.5).max() < 0.1 + 1e-6
    if c == 0.0 and h is None:
        # it swings, as it would without end
        assert results.stats["steps"] > 10_000
    elif k / max(c, 1.0) > 100.0:
        assert abs(x[-1] - 0.5) <= 0.3 * WEIGHT / k + 1e-3
        assert np.abs(v).max() < 1e-2
    else:
        assert 0.0999 < x[-1] - 0.5
    assert results["bodies/2/position"][:, 2] == pytest.approx(0.1, abs=3e-4)


@pytest.mark.parametrize("make", [spring, by_expression])
def test_springs_that_are_not_stiff_are_of_order_two(tmp_path: Path, make: Make) -> None:
    """Against the damped oscillation in closed form, on a floor without friction."""
    k, c, errors = 100.0, 2.0, []
    for h in (0.02, 0.01, 0.005):
        results = held(tmp_path, make(20, 11, k, c), 0.0, h)
        t, w = results["time"], np.sqrt(k - 0.25 * c * c)
        exact = 0.1 * np.exp(-0.5 * c * t) * (np.cos(w * t) + 0.5 * c / w * np.sin(w * t))
        errors.append(np.abs(results["bodies/2/position"][:, 0] - 0.5 - exact).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]).min() > 1.8
    assert errors[-1] < 1e-4


@pytest.mark.parametrize("h", [5e-3, None])
def test_balls_that_a_stiff_bushing_joins_fall_as_one(tmp_path: Path, h: float | None) -> None:
    """One lands, the other one is held up by it: the bushing's own time is 1e-4 s."""
    parts = [
        text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.2)),
        text.sphere(3, 1.0, 0.1, (0.0, 0.0, 0.5)),
        text.marker(21, 2, (0.0, 0.0, 0.2)),
        text.marker(31, 3, (0.0, 0.0, 0.2)),
        bushing(31, 21, 1e8, 1e4),
        text.contact(301, [200, 300], [100], **decks.rubbed(0.5)),
        text.gravity(),
    ]
    results = mbsim.simulate(decks.model(tmp_path, parts, 1.0, h), integrator="MOREAU", tol=1e-4)
    lower, upper = results["bodies/2/position"], results["bodies/3/position"]
    assert np.abs(upper - lower - [0.0, 0.0, 0.3]).max() < 1e-3
    assert lower[-1, 2] == pytest.approx(0.1, abs=1e-4)
    assert results["contacts/301/force"][-1, 2] == pytest.approx(2.0 * WEIGHT, rel=2e-3)
    assert results.stats["steps"] < 400


@pytest.mark.parametrize("h", [1e-2, None])
def test_a_stiff_state_of_the_users_follows(tmp_path: Path, h: float | None) -> None:
    """Of z' = 1e5 (x - z) nothing but x is left."""
    follows = '<Control_Diff id="7" expr="1e5*(DX(20,11)-DIF(7))" ic="0.6"/>'
    asks = '<Post_Request id="1" type="EXPRESSION" expr1="DIF(7)-DX(20,11)"/>'
    force = spring(20, 11, 100.0, 2.0) + follows + asks
    results = held(tmp_path, force, 0.0, h)
    assert np.abs(results["requests/1"][:, 0]).max() < 1e-2


def test_forces_of_very_many_bodies_are_explicit_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The linear systems keep a table of all pairs of bodies."""
    monkeypatch.setattr("mbsim.stepping.setup.MOST_BODIES", 0)
    parts = [
        decks.cube(2, 1.0, 0.2, (0.6, 0.0, 0.1)),
        text.marker(11, 1, (0.0, 0.0, 0.1)),
        text.contact(301, [200], [100], **decks.rubbed(0.0)),
        text.gravity(),
        spring(20, 11, 100.0, 2.0),
    ]
    model = decks.model(tmp_path, parts, 0.2, 0.01)
    explicit = mbsim.simulate(model, integrator="MOREAU", output=tmp_path / "few")
    log = next((tmp_path / "few").glob("*.log")).read_text(encoding="utf-8")
    assert "forces are explicit, and stiff ones bound the step: 1 bodies are more than" in log
    monkeypatch.undo()
    implicit = mbsim.simulate(model, integrator="MOREAU")
    x = "bodies/2/position"
    assert np.abs(explicit[x] - implicit[x]).max() < 1e-4


@pytest.mark.parametrize("h", [1e-2, 5e-3, 2e-3])
def test_a_walker_with_stiff_drives_keeps_to_its_way(tmp_path: Path, h: float) -> None:
    """A drive's damper takes off what its link has within 0.7 ms; steps may be longer."""
    path = tmp_path / "quadruped.xml"
    path.write_text(s13_quadruped._deck({"h": h}), encoding="utf-8")
    run = mbsim.simulate(path, integrator="MOREAU", tol=1e-3)
    path.write_text(s13_quadruped._deck({"h": 2.5e-4}), encoding="utf-8")
    exact = mbsim.simulate(path, integrator="MOREAU", tol=1e-5)
    away = np.linalg.norm(run["bodies/2/position"] - exact["bodies/2/position"], axis=1)
    assert away.max() < 5.0 * h


def tray(folder: Path, balls: int) -> mbsim.Results:
    """Return a tray of 5 kg on a bushing, with so many spheres in a row on it, after 0.2 s."""
    ids = [100 * (3 + k) for k in range(balls)]
    spheres = [
        text.sphere(3 + k, 0.1, 0.02, (0.05 * k - 0.025 * (balls - 1), 0.0, 0.57))
        for k in range(balls)
    ]
    shape = text.attributes(
        id=200,
        type="BoxDefinedFromCenter",
        center_marker_id=20,
        length_x=1.0,
        length_y=0.2,
        length_z=0.1,
    )
    parts = [
        text.body(2, 5.0, [0.03, 0.4, 0.4], (0.0, 0.0, 0.5)) + f"\n<Post_Graphic {shape}/>",
        text.marker(11, 1, (0.0, 0.0, 0.5)),
        *spheres,
        text.contact(301, ids, [200], **decks.rubbed(0.3)),
        text.gravity(),
        bushing(20, 11, 1e6, 1e4),
    ]
    return mbsim.simulate(decks.model(folder, parts, 0.2, 2e-3), integrator="MOREAU", tol=1e-6)


def test_what_a_held_body_answers_is_found_once_for_all_its_points(tmp_path: Path) -> None:
    """Spheres on a tray: six solutions in a step for two, as three each, and for twenty.

    Each of twenty presses as its weight does, as one of two.
    """
    few, many = tray(tmp_path, 2), tray(tmp_path, 20)
    assert few.stats["contact_answers"] == many.stats["contact_answers"] == 6 * 100
    for results, count in ((few, 2), (many, 20)):
        assert results.audit.warnings == ()
        force = results["contacts/301/force"][-1, 2]
        assert force == pytest.approx(0.1 * count * WEIGHT, rel=1e-3)
        sunk = 0.5 - results["bodies/2/position"][-1, 2]
        assert sunk == pytest.approx((5.0 + 0.1 * count) * WEIGHT / 1e6, rel=1e-2)

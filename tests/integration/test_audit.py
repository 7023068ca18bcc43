"""A run judges itself: sound runs close and say so, faults are told with time and element.

Faults are put in from outside, as those of earlier versions were: velocities or energies that go
wrong by themselves in flight, friction above its cone, a joint that is off; and two runs of
earlier versions are kept as arrays of what their samples saw.
"""

from __future__ import annotations

import ctypes
import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.audit_runs import FREE_FLIGHT, INCLINE, LOOPS
from helpers.decks import GROUND, contact, run_in_pieces, run_model, sphere, write_deck
from helpers.folders import MODELS
from mbsim.arrays import codes
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.cli.main import main
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import pack, vector_at, view
from mbsim.core.problem import HOOK
from mbsim.dynamics.pipeline.audit import examine
from mbsim.dynamics.pipeline.hook_table import fill
from mbsim.integrators import scheme
from mbsim.results.audit import ENTRIES, audit_of
from mbsim.run import loop

ENERGY = {"energy", "energy_step"}


def names_of(warnings):
    """Return which entries warnings are of, by what these say first."""
    said = {judged.name: judged.says.split("{")[0] for judged in ENTRIES}
    return {name for name, text in said.items() if any(w.startswith(text) for w in warnings)}


def with_fault(monkeypatch, when, fault):
    """Let `fault(runner)` happen at the first step that ends at `when` or later."""
    plain = loop.Runner.__init__

    def begin(runner, *given, **named):
        plain(runner, *given, **named)
        advance, due = runner._advance, [True]

        def advance_to_fault(steps, end, *others):
            if not due[0]:
                return advance(steps, end, *others)
            outcome = advance(steps, end, *others[:-1], 1)
            if runner.method.memory[scheme.TIME] >= when:
                due[0] = False
                fault(runner)
            return outcome

        runner._advance = advance_to_fault

    monkeypatch.setattr(loop.Runner, "__init__", begin)


@pytest.mark.parametrize("integrator", ["DOPRI5", "GALPHA"])
def test_a_sound_run_says_how_far_its_balance_closes(integrator, tmp_path):
    told = []
    with run_model(
        "bouncing_sphere.xml", integrator=integrator, output=tmp_path, notify=told.append
    ) as results:
        audit = results.audit
        assert audit is not None
        assert audit.warnings == ()
        assert not [line for line in told if "warning" in line]
        assert 0.0 < audit.balance < 1e-3 * audit.of
        # it is as large as the ball's fall
        fall = results["energy/potential"]
        assert audit.of == pytest.approx(np.ptp(fall), rel=2e-2)
        assert audit.line == f"balance closes to {audit.balance:.1g} of {audit.of:.3g} J"
        assert {*ENERGY, "momentum", "angular_momentum"} <= set(audit.entries)
        total = sum(share.change for share in audit.contacts.values())
        ends = [sum(results[f"energy/{name}"][k] for name in mbsim_energies()) for k in (0, -1)]
        assert total == pytest.approx(ends[1] - ends[0], abs=1e-3 * audit.balance + 1e-12)
        assert audit.line in (tmp_path / "bouncing_sphere.log").read_text()


def mbsim_energies():
    """Return the energies of a model without motions."""
    return ("kinetic", "potential", "dissipated")


def test_the_command_line_shows_it(tmp_path):
    deck, cli = str(MODELS / "bouncing_sphere.xml"), CliRunner()
    shown = cli.invoke(main, ["run", deck, "-o", str(tmp_path), "--end-time", "0.5"])
    assert shown.exit_code == 0
    with mbsim.open_results(tmp_path / "bouncing_sphere.h5") as results:
        audit = results.audit
    assert audit is not None
    assert audit.line in shown.output
    again = ["run", deck, "-o", str(tmp_path), "--end-time", "0.5", "--json"]
    printed = json.loads(cli.invoke(main, again).stdout)["audit"]
    assert printed["balance"] == audit.balance
    assert printed["warnings"] == []
    told = cli.invoke(main, ["info", str(tmp_path / "bouncing_sphere.h5"), "--json"])
    assert json.loads(told.stdout)["audit"] == printed
    plain = cli.invoke(main, ["info", str(tmp_path / "bouncing_sphere.h5")]).output
    assert f"{audit.balance:.9g}" in plain


def test_a_resumed_run_judges_as_the_straight_one(tmp_path, monkeypatch):
    model = mbsim.read_model(MODELS / "bouncing_sphere.xml")
    with mbsim.simulate(model, end_time=1.0) as straight:
        one = straight.audit
    with run_in_pieces(model, tmp_path, monkeypatch, end_time=1.0) as pieces:
        assert pieces.audit == one


def test_wrong_accelerations_in_flight_are_told(tmp_path, monkeypatch):
    """A velocity that goes wrong by 1 % of V, as a step with a wrong linearisation leaves it."""

    def push(runner):
        runner.method.y[9] -= 0.03

    with_fault(monkeypatch, 1e-3, push)
    deck = write_deck(tmp_path, GROUND + GRAVITY + sphere(1.0) + contact(), 0.3)
    told = []
    with mbsim.simulate(
        mbsim.read_model(deck), integrator="DOPRI5", output=tmp_path, notify=told.append
    ) as results:
        audit = results.audit
    assert audit is not None
    assert "momentum" in names_of(audit.warnings)
    assert "Body_Rigid[2]" in audit.entries["momentum"].element
    assert 1e-3 < audit.entries["momentum"].time <= 0.3
    # on the terminal and in the log too
    assert all(f"warning: {warning}" in told for warning in audit.warnings)
    log = (tmp_path / "deck.log").read_text()
    assert all(f"warning: {warning}" in log for warning in audit.warnings)


GRAVITY = '<Force_Gravity grav_z="-9.81"/>'


def test_energy_that_a_contact_makes_is_told(tmp_path, monkeypatch):
    """A ball that leaves faster than it came: energy, and the contact that pressed."""

    def push(runner):
        runner.method.y[9] *= 1.01

    with_fault(monkeypatch, 0.135, push)
    model = GROUND + GRAVITY + sphere(0.19) + contact(stiffness=1e4, exponent=1.0, damping=0.0)
    with mbsim.simulate(
        mbsim.read_model(write_deck(tmp_path, model, 0.3)), integrator="DOPRI5"
    ) as results:
        audit = results.audit
    assert audit is not None
    assert names_of(audit.warnings) == {"energy_step"} or ENERGY <= names_of(audit.warnings)
    assert "Force_Contact[301]" in audit.entries["energy_step"].element
    assert abs(audit.contacts[301].largest) > 10.0 * abs(audit.contacts[None].largest)


def test_friction_above_its_cone_is_told(tmp_path, monkeypatch):
    def give_friction(runner):
        runner.system.scene.contacts.friction_par[0, :2] *= 1.1

    with_fault(monkeypatch, 0.05, give_friction)
    friction = {
        "cff_type": "COULOMB_ON",
        "mu_static": 0.3,
        "mu_dynamic": 0.3,
        "stiction_trans_vel": 1e-3,
        "friction_trans_vel": 2e-3,
    }
    model = GROUND + GRAVITY + sphere(0.1, v=(1.0, 0.0, 0.0)) + contact(**friction)
    with mbsim.simulate(
        mbsim.read_model(write_deck(tmp_path, model, 0.1)), integrator="DOPRI5"
    ) as results:
        audit = results.audit
    assert audit is not None
    assert names_of(audit.warnings) == {"cone"}
    # a part of the largest mu N, that of the touch
    assert 0.01 < audit.entries["cone"].value < 0.1
    assert audit.entries["cone"].time >= 0.05


@pytest.mark.parametrize("law", ["COULOMB_ON", "COULOMB_DYNAMICONLY", "TANH", "STICTION"])
def test_no_friction_is_within_a_cone_of_none(law, tmp_path):
    """A force along a normal that is askew has rounding across it."""
    model = (
        GROUND
        + sphere(0.12, v=(0.7, 0.3, 0.0))
        + contact(cff_type=law, mu_static=0.0, mu_dynamic=0.0)
        + '<Force_Gravity grav_x="1.3" grav_y="0.7" grav_z="-9.81"/>'
    ).replace(
        'id="10" body_id="1"',
        'id="10" body_id="1" a00="1" a11="0.96" a21="0.28" a12="-0.28" a22="0.96"',
    )
    path = write_deck(tmp_path, model, 0.5, 0.05)
    with mbsim.simulate(mbsim.read_model(path)) as results:
        assert results["contacts/301/penetration"].max() > 0.0
        assert results.audit.warnings == ()


def test_energy_of_a_mechanism_is_judged(monkeypatch):
    """Without contact: all bodies of a four-bar are 5 % faster from one step to the next."""

    def hasten(runner):
        for at in range(0, 13 * len(runner.system.body_ids), 13):
            runner.method.y[at + 7 : at + 13] *= 1.05

    with_fault(monkeypatch, 0.1, hasten)
    with run_model("four_bar.xml", integrator="DOPRI5", end_time=0.4) as results:
        audit = results.audit
    assert audit is not None
    assert names_of(audit.warnings) >= {"energy_step"}
    assert "Constraint_Joint[" in audit.entries["position"].element
    assert "velocity" in audit.entries
    assert audit.entries["energy_step"].element == ""


def stand_in(tmp_path, scale):
    """Return a system of one ball whose energies can be set to what a run had."""
    deck = write_deck(tmp_path, GROUND + GRAVITY + sphere(1.0) + contact())
    system = build(mbsim.read_model(deck), 1.0)
    scene = system.scene
    # small against the speed, so that this is the scale of energy
    scene.scales.length[:], scene.scales.speed[:] = 1e-3, np.sqrt(scale)
    scene.work.R[:] = np.eye(3)
    return system


def sample(context, t, h, a, b):
    """What a run judges itself by, at a committed state."""
    scene = view(context, Scene)
    examine(scene, t, h, vector_at(a, scene.rows.y.shape[1]))
    return 0


@pytest.mark.parametrize(
    ("run", "finds"),
    [(FREE_FLIGHT, ENERGY | {"momentum"}), (LOOPS, {"energy"}), (INCLINE, {"energy_step"})],
)
def test_what_earlier_versions_did_unsaid_is_told(run, finds, tmp_path):
    """Samples of three runs that were wrong and said nothing."""
    system = stand_in(tmp_path, run.scale)
    scene, y = system.scene, system.y0.copy()
    plan, tally, work = scene.audit.plan, scene.audit.tally, scene.work
    # contacts answer behind an address, which compiled code alone calls
    fill(scene, only=(Hook.CONTACTS,))
    table, pointer = pack(scene), ctypes.c_void_p
    form = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, pointer, pointer
    )
    examined = form(jit.address(sample, HOOK))
    plan[codes.AUDIT_TOL] = run.tol
    for k, (steps, errors, t, speed, potential, dissipated, touches) in enumerate(run.samples):
        # the ball has 1 kg
        y[9], y[2] = speed, potential / 9.81
        y[-1] = dissipated
        work.hit[-1], work.hit[0] = int(touches > 0), 0
        work.slot[0] = 0.0
        tally[codes.STEPS_SINCE], tally[codes.ERRORS_SINCE] = steps - 1.0, errors
        tally[codes.ERROR_NOW] = 0.0
        examined(table.ctypes.data, t, 0.0 if k == 0 else 1e-9, y.ctypes.data, y.ctypes.data)
    audit = audit_of(system, 0.0, 0.0)
    assert audit is not None
    assert names_of(audit.warnings) >= finds
    assert audit.balance == pytest.approx(run.balance, rel=1e-6)

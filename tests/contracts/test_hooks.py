"""A hook that fails ends the run with its code, whichever it is and whoever asks."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest

import mbsim
from helpers import mechanism_decks, pile_decks
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, write_deck
from helpers.folders import CORPUS, MODELS
from helpers.mechanics import Body
from helpers.surfaces import IMPACT, angle_on_ground
from mbsim.arrays.codes import NEAR_FOLD
from mbsim.arrays.hooks import (
    Contacts,
    ContactSlopes,
    Dry,
    Effects,
    Gauges,
    Hook,
    Joints,
    Memory,
    Recall,
    Sticking,
)
from mbsim.core import jit
from mbsim.dynamics.pipeline import hook_table, problem
from mbsim.errors import SolverError

FAILS = 77
SIGNATURES = {row.hook: row.signature for row in hook_table.TABLE}
#: Those that answer, so that a code is negative.
ANSWERS = {row.hook for row in hook_table.TABLE if "answer" in row.result}

#: No hook, one that explores laws (what they say then is nothing that they are asked), and those
#: that only calculate.
NEVER_FAIL = {row.hook for row in hook_table.TABLE if "cannot fail" in row.result} | {
    Hook.TANGENT,
    Hook.STEPPING,
    Hook.STABILITY,
}

#: What one method alone measures.
METHOD_OF = {Effects.FRICTION: "GALPHA", Effects.IMPACT: "GALPHA"}

# hook, request (None for any), deck, method
CASES = [
    *((Hook.CONTACTS, what, "bowling_ball", "DOPRI5") for what in Contacts),
    (Hook.FCL, None, "bouncing_sphere", "DOPRI5"),
    (Hook.SLOTS, None, "angle", "DOPRI5"),
    (Hook.SPREAD, None, "angle", "DOPRI5"),
    (Hook.RIM, None, "cylinder", "DOPRI5"),
    (Hook.TILTING, None, "contensou_disc", "DOPRI5"),
    *((Hook.RECALL, what, "lugre_stick_slip", "DOPRI5") for what in Recall),
    (Hook.VALUE, None, "dry_friction_element", "DOPRI5"),
    (Hook.JET, None, "cam", "DOPRI5"),
    (Hook.APPLIED, None, "cam", "DOPRI5"),
    (Hook.WRENCH, None, "stiff/bushing_chain", "DOPRI5"),
    (Hook.ELEMENT, None, "dry_friction_element", "DOPRI5"),
    *((Hook.JOINTS, what, "cam", "DOPRI5") for what in Joints),
    *(
        # far from the limit what loads it is not found exactly
        (Hook.STICKING, what, "pulled" if what is Sticking.LOAD else "stiction_rigid", "RADAU5")
        for what in Sticking
    ),
    (Hook.RELATIONS, None, "coupler_user", "DOPRI5"),
    (Hook.REACTION_FORCES, None, "pin", "DOPRI5"),
    (Hook.EVALUATE, None, "dry_friction_element", "DOPRI5"),
    (Hook.BEND, None, "four_bar", "RADAU5"),
    *((Hook.CONTACT_SLOPES, what, "bowling_ball", "RADAU5") for what in ContactSlopes),
    *((Hook.MEMORY, what, "lugre_stick_slip", "RADAU5") for what in Memory),
    (Hook.SLOPES, None, "stiff/bushing_chain", "RADAU5"),
    (Hook.MEMORY_PAIR, None, "lugre_stick_slip", "RADAU5"),
    *((Hook.GAUGES, what, "bowling_ball", "DOPRI5") for what in Gauges),
    *((Hook.EFFECTS, what, "bowling_ball", METHOD_OF.get(what, "RADAU5")) for what in Effects),
    *((Hook.DRY, what, "dry_friction_element", "DOPRI5") for what in Dry),
    (Hook.ANGLES, None, "cam", "DOPRI5"),
    (Hook.NEAR, None, "broadphase", "DOPRI5"),
    (Hook.REQUESTS, None, "dry_friction_element", "DOPRI5"),
]
# joints are asked for displacements a time by implicit methods alone
CASES = [
    (hook, what, deck, "RADAU5" if what is Joints.ALONG else method)
    for hook, what, deck, method in CASES
    if hook is not Hook.JOINTS or what <= Joints.AUDIT
]
# and for impulses by that whose contacts are rigid
CASES += [
    (Hook.JOINTS, what, "belt_stick_slip", "MOREAU") for what in Joints if what > Joints.AUDIT
]


def _pin():
    # a pendulum whose pin rubs
    body = Body(2.0, (0.06, 0.05, 0.04), p=(0.7, 0.0, 0.0))
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    friction = (
        '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY" '
        'mu_dynamic="0.2" friction_trans_vel="0.001" pin_radius="0.1"/>'
    )
    joint = mechanism_decks.Joint("REVOLUTE", 1, 0, (0, 0, 0), axes)
    return mechanism_decks.Scene([body], [joint], extra=friction).xml()


def _cylinder():
    return (
        GROUND
        + '<Reference_Marker id="20" body_id="2"/>'
        + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>'
        + '<Post_Graphic id="200" type="Cylinder" center_marker_id="20" radius="1" length="1"/>'
        + contact(**COULOMB)
        + GRAVITY
    )


def _pulled():
    # to just below what friction can, and back
    text = (MODELS / "stiction_rigid.xml").read_text(encoding="utf-8")
    text = text.replace("-1e4*DX(20,11)", "0.999*SIN(60*TIME)").replace("-1e4*DY(20,11)", "0")
    return text.partition("<Model>")[2].partition("</Model>")[0]


def _contact_set():
    return pile_decks.pile(pile_decks.block(4, 0.25))


def model_of(deck, folder):
    """Return the model of a deck of `models/` or of the corpus, or of one above."""
    made = {
        "pin": _pin,
        "pulled": _pulled,
        "broadphase": _contact_set,
        "cylinder": _cylinder,
        "angle": lambda: angle_on_ground(0.0501, IMPACT),
    }
    if deck in made:
        return mbsim.read_model(write_deck(folder, made[deck]()))
    path = MODELS / f"{deck}.xml"
    return mbsim.read_model(path if path.is_file() else CORPUS / path.name)


class Failure:
    """A hook that returns its code from some call on, or for one request, as else the hook does."""

    def __init__(self, hook, request):
        self.hook, self.request, self.asked, self.kept = hook, request, 0, []

    def put(self, scene):
        """Take the place of the hook of a scene, which has one."""
        address = int(scene.world.hooks[self.hook])
        if address in (0, jit.NOT_YET) or self.kept:
            return
        signature = SIGNATURES[self.hook]
        form, own = signature.form, signature.at(address)

        def serve(*given):
            if self.request is Joints.PROJECT_TREE:
                scene.sweep.quality[NEAR_FOLD] = 1.0
            if self.request is not None and given[1] != self.request:
                return own(*given)
            self.asked += 1
            if self.hook in (Hook.VALUE, Hook.GAUGES, Hook.EFFECTS):
                # it returns a number: its code is noted
                scene.users.failed[0] = FAILS
                return math.nan
            return -FAILS if self.hook in ANSWERS else FAILS

        self.kept.append(form(serve))
        scene.world.hooks[self.hook] = ctypes.cast(self.kept[0], ctypes.c_void_p).value


@pytest.mark.parametrize(
    ("hook", "request_", "deck", "method"),
    CASES,
    ids=[f"{hook.name}-{what.name if what is not None else 'any'}" for hook, what, *_ in CASES],
)
def test_a_hook_that_fails_ends_the_run(hook, request_, deck, method, tmp_path, monkeypatch):
    failure = Failure(hook, request_)

    def fill(scene, *given, plain=problem.fill, **named):
        plain(scene, *given, **named)
        failure.put(scene)

    monkeypatch.setattr(problem, "fill", fill)
    monkeypatch.setattr(hook_table, "fill", fill)
    detector = "fcl" if hook is Hook.FCL else "auto"
    with pytest.raises(SolverError, match=f"code {FAILS} at time"):
        mbsim.simulate(model_of(deck, tmp_path), integrator=method, detector=detector)
    assert failure.asked > 0


def test_every_hook_and_request_is_tried():
    tried = {(hook, what) for hook, what, *_ in CASES}
    requests = {
        Hook.CONTACTS: Contacts,
        Hook.GAUGES: Gauges,
        Hook.EFFECTS: Effects,
        Hook.RECALL: Recall,
        Hook.CONTACT_SLOPES: ContactSlopes,
        Hook.JOINTS: Joints,
        Hook.STICKING: Sticking,
        Hook.DRY: Dry,
        Hook.MEMORY: Memory,
    }
    for hook in set(Hook) - NEVER_FAIL:
        for what in requests.get(hook, (None,)):
            assert (hook, what) in tried, (hook, what)


def test_the_table_has_a_row_for_every_hook_in_its_order():
    order = [row.hook for row in hook_table.TABLE]
    assert order == [hook for hook in Hook if hook not in (Hook.TANGENT, Hook.STEPPING)]

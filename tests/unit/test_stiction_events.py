"""Events of rigid stiction: what sticks again has told that it slipped."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from mbsim.arrays.codes import SLIP as SLIP_EVENT
from mbsim.arrays.codes import STICK as STICK_EVENT
from mbsim.dynamics.stiction import rigid_contact
from mbsim.laws.catalog import SLIP, STICK
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_SPEED, KEPT_X


def test_a_crossing_that_holds_nothing_for_a_while_tells_both(monkeypatch):
    told, parallel = [], []
    state = SimpleNamespace(
        touching=np.ones(1, dtype=int),
        memory=np.zeros((1, 5)),
        before=np.zeros((1, 5)),
        mode=np.full(1, float(STICK)),
        chattering=np.zeros(8),
    )
    scene = SimpleNamespace(state=state, equations=SimpleNamespace(slot=[0, 0]))
    monkeypatch.setattr(rigid_contact, "first_of_slots", lambda _: 0)
    monkeypatch.setattr(rigid_contact, "holds_nothing", lambda *_: parallel[-1])
    monkeypatch.setattr(rigid_contact, "record_event", lambda _s, t, kind, _: told.append(kind))
    state.memory[0, KEPT_MODE] = STICK
    for crosses, mode in ((False, STICK), (True, SLIP), (True, SLIP), (False, STICK)):
        parallel.append(crosses)
        # as a step is committed, then begun
        state.before[:] = state.memory
        state.memory[0, [KEPT_MODE, KEPT_X, KEPT_SPEED]] = mode, 1.0, 1.0
        rigid_contact.record_sticking(scene, 0.0, np.zeros(1))
    assert told == [SLIP_EVENT, STICK_EVENT]

"""Every array of the compiled pipeline, grouped by use: shape and meaning on its line.

Counts: nb moving bodies (row nb of a body array is ground), ng graphics, nk kinds, np rows
for pairs, nc contacts, ns slots. A *slot* is room for one incident: a pair owns a range of
slots. A contact of few graphics lists all its pairs for good; one of many, a *large contact*, lists
those that are near, and the list follows the motion (contact.broadphase). Everything is in model
units, global frame unless said otherwise.

The ODE vector y holds, body after body, BODY_SIZE numbers: position of the cg (3), unit
quaternion w first (4), velocity of the cg (3), angular velocity in cg axes (3); then, slot by
slot, X (3) where the law uses it and the law's memory where that is integrated; then the user's own
states, one number each; then the work of motions and what applied forces dissipated, where there
are any (`World.accumulators`); then the work of friction of each contact that has friction
(`Audit.friction_at`), which counts in no error; last the energy that each contact has dissipated so
far (one number where there is no contact, so that y is never empty).
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.arrays.graph import ConstraintGraph
from mbsim.arrays.model import (
    Angles,
    Applied,
    Bodies,
    Connections,
    Contacts,
    Curves,
    Equations,
    Graphics,
    Kinds,
    Markers,
    Programs,
    Residuals,
    Scales,
    Sensors,
    Slots,
    States,
    Surfaces,
    Switching,
    Tree,
    Users,
    World,
)
from mbsim.arrays.scratch import Rows, Sweep, Work
from mbsim.arrays.state import Audit, Awake, Broadphase, Log, Pairs, State


class Scene(NamedTuple):
    """Everything a compiled hook gets through its one address."""

    bodies: Bodies
    graphics: Graphics
    kinds: Kinds
    pairs: Pairs
    broadphase: Broadphase
    contacts: Contacts
    slots: Slots
    markers: Markers
    angles: Angles
    curves: Curves
    surfaces: Surfaces
    programs: Programs
    states: States
    sensors: Sensors
    switching: Switching
    users: Users
    residuals: Residuals
    applied: Applied
    tree: Tree
    equations: Equations
    connections: Connections
    graph: ConstraintGraph
    world: World
    scales: Scales
    state: State
    awake: Awake
    log: Log
    audit: Audit
    work: Work
    sweep: Sweep
    rows: Rows

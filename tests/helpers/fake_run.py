"""A system that nothing integrates: tests fill its output rows by hand.

Run as a program, it records, flushes, records more and kills itself.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from helpers.minimal_deck import added, read
from mbsim.arrays import codes
from mbsim.arrays.model import Graphics
from mbsim.arrays.scratch import Rows
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.pairing import plan_pairs
from mbsim.compile_model.scratch import empty_log
from mbsim.core.layout import BODY_SIZE
from mbsim.model.elements import Model
from mbsim.model.placement import place
from mbsim.results.elements import APPLIED, CONSTRAINTS, elements_of
from mbsim.results.recorder import Recorder

REQUEST = '<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20" label="ball"/>'
SETTINGS: dict[str, Any] = {
    "mbsim_version": "0.1.0",
    "model_file": "deck.xml",
    "model_sha256": "abc",
    "units": "NEWTON KILOGRAM METER SECOND",
    "integrator": "DOPRI5",
    "tol": 1e-5,
    "end_time": 3.0,
}
CAPACITY = 64


def fake_system(folder: Path, statement: str = REQUEST) -> Any:
    """Return one ball, one contact, one slot, with room for rows."""
    folder.mkdir(parents=True, exist_ok=True)
    return fake_system_of(read(folder, added(statement)))


def fake_system_of(model: Model) -> Any:
    """Return the model as a system whose rows are empty."""
    placement = place(model)
    bodies = list(placement.bodies.values())
    nb, nc = len(bodies), len(model.contacts)
    n = BODY_SIZE * nb + 1
    y0 = np.zeros(n)
    for k, body in enumerate(bodies):
        row = y0[BODY_SIZE * k :]
        row[0:3], row[3:7], row[7:10] = body.p, body.q, body.v
    row_of = {body.id: nb for body in model.bodies.values()}
    row_of |= {body.id: k for k, body in enumerate(bodies)}
    table = MarkerTable(placement, row_of)
    connections, of_connections = ends(model, CONSTRAINTS, table)
    applied, of_applied = ends(model, APPLIED, table)
    values = [
        (request.id, number)
        for request in model.requests.values()
        for number, expr in enumerate(request.exprs, 1)
        if expr is not None
    ]
    log = empty_log(nc).contacts
    rows = Rows(
        time=np.zeros(CAPACITY),
        y=np.zeros((CAPACITY, n)),
        accel=np.zeros((CAPACITY, 6 * nb)),
        contact=np.zeros((CAPACITY, codes.CONTACT_COLUMNS * nc)),
        energy=np.zeros((CAPACITY, 4)),
        joint=np.zeros((CAPACITY, 6 * len(connections))),
        applied=np.zeros((CAPACITY, 6 * len(applied))),
        value=np.zeros((CAPACITY, len(values))),
        incident_count=np.zeros(CAPACITY, dtype=np.int64),
        incidents=np.zeros((CAPACITY, 14)),
        points=np.zeros((0, codes.POINT_COLUMNS)),
        events=np.zeros((CAPACITY, 4)),
        used=np.zeros(3, dtype=np.int64),
    )
    contacts = SimpleNamespace(
        id=np.array(list(model.contacts)),
        normal_par=np.array([[c.stiffness] for c in model.contacts.values()]),
        friction_par=np.array(
            [
                [c.mu_static, c.mu_dynamic, c.stiction_trans_vel, c.friction_trans_vel]
                for c in model.contacts.values()
            ]
        ),
        numbers=np.zeros((nc, 1)),
    )
    scene = SimpleNamespace(
        bodies=(np.array([body.mass for body in bodies]),),
        graphics=Graphics(*[np.zeros(0)] * len(Graphics._fields)),
        contacts=contacts,
        world=SimpleNamespace(
            gravity=np.array(model.gravity.g), scale=np.ones(2), accumulators=np.full(2, -1)
        ),
        markers=table.arrays()[0],
        connections=of_connections,
        applied=of_applied,
        # all bodies hang on the first by some tree of 4 free directions, and 3 equations hold
        tree=SimpleNamespace(of_body=np.arange(nb + 1), free=np.array([4])),
        equations=SimpleNamespace(active=np.array([0, 1, 2, 3])),
        states=SimpleNamespace(offset=np.zeros(0, dtype=np.int64)),
        log=empty_log(nc)._replace(contacts=log),
        rows=rows,
    )
    return SimpleNamespace(
        unknowns=lambda: iter(()),
        residuals={},
        model=model,
        placement=placement,
        scene=scene,
        y0=y0,
        body_ids=list(placement.bodies),
        contact_ids=list(model.contacts),
        plans=plan_pairs(model),
        connections=connections,
        applied=applied,
        marker_rows=table.rows,
        values=values,
        user_friction={},
        user_normal={},
        user_laws=[],
        posts=[],
        subroutines={},
    )


def ends(model: Model, statements: tuple[str, ...], table: MarkerTable) -> tuple[Any, Any]:
    """Return (statement, id) of elements, and the rows of their markers I and J."""
    found, i, j = [], [], []
    for statement in statements:
        for id, element in elements_of(model, statement).items():
            joint_id = getattr(element, "joint_id", None)
            held = model.joints[joint_id] if joint_id else element
            found.append((statement, id))
            i.append(table.row(getattr(held, "i_marker_id", 0)))
            j.append(table.row(getattr(held, "j_marker_id", 0)))
    return found, SimpleNamespace(i=np.array(i, dtype=np.int64), j=np.array(j, dtype=np.int64))


def add_rows(system: Any, first: int, count: int, events: bool = True) -> None:
    """Append rows whose values say which row they are: time k / 10, x = k, odd rows touch."""
    rows = system.scene.rows
    for k in range(first, first + count):
        at = int(rows.used[0])
        rows.time[at] = 0.1 * k
        rows.y[at] = system.y0
        rows.y[at, 0] = k
        rows.y[at, 10:13] = (0.0, 0.0, 0.5)
        rows.accel[at] = k
        rows.contact[at].reshape(-1, codes.CONTACT_COLUMNS)[:] = (
            np.arange(codes.CONTACT_COLUMNS) + 100 * k
        )
        rows.energy[at] = (k, 2 * k, 3 * k, 4 * k)
        for table in (rows.joint, rows.applied):
            table[at] = np.arange(table.shape[1]) + 100 * k
        rows.value[at] = np.arange(rows.value.shape[1]) + 1 + k
        rows.incident_count[at] = k % 2
        if k % 2:
            rows.incidents[rows.used[1]] = k
            rows.used[1] += 1
        rows.used[0] = at + 1
    if events:
        # within a step the slots come in any order
        for time, kind in ((0.1 * first + 0.05, codes.LEAVE), (0.1 * first + 0.01, codes.TOUCH)):
            rows.events[rows.used[2]] = (time, kind, system.contact_ids[0], 0)
            rows.used[2] += 1


def checkpoint(row: int) -> dict[str, np.ndarray[Any, Any]]:
    """Return a checkpoint that says after which row it was made."""
    return {
        "method/y": np.full(4, float(row)),
        "state/none": np.zeros((0, 3)),
        "stage": np.array(row),
    }


def die_between_flushes(folder: Path) -> None:
    """Flush after 10 rows, write 30 more to the part file, and be killed."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    for first, count in ((0, 5), (5, 5)):
        add_rows(system, first, count)
        recorder.take()
    recorder.flush(checkpoint(10))
    add_rows(system, 10, 30)
    recorder.take()
    recorder._write()
    recorder._store.file.flush()
    os.kill(os.getpid(), signal.SIGKILL)


def fill_the_disk(folder: Path, limit: int) -> None:
    """Record with files limited in size; print the error, and go on as `simulate` does."""
    import resource

    from mbsim.errors import ResultsError

    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    add_rows(system, 0, 10)
    recorder.take()
    recorder.flush(checkpoint(10))
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        for k in range(2000):
            add_rows(system, 10 + 60 * k, 60)
            recorder.take()
            if k % 100 == 99:
                recorder.flush(checkpoint(k))
    except ResultsError as error:
        print(error)
        recorder.take()
        recorder.flush(checkpoint(0))
        sys.exit(error.exit_code)


if __name__ == "__main__":
    if sys.argv[1] == "die":
        die_between_flushes(Path(sys.argv[2]))
    else:
        fill_the_disk(Path(sys.argv[2]), int(sys.argv[3]))

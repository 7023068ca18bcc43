"""What the programs of expressions depend on: bodies, states, subroutines."""

from __future__ import annotations

import numpy as np

from mbsim.arrays.scene import Scene
from mbsim.compile_model import instructions as p
from mbsim.compile_model.tangent import Depends

#: How many of an instruction's numbers are markers, from the first on.
_MARKERS = {
    p.DISTANCE: 2,
    p.OFFSET: 3,
    p.TURN: 2,
    p.ORIENT: 2,
    p.INCLUDED: 3,
    p.SPEED: 3,
    p.CLOSING: 2,
    p.VELOCITY: 4,
    p.TURNING: 2,
    p.SPIN: 3,
}


def find_depends(scene: Scene) -> Depends:
    """Return moving bodies and states that each program looks at.

    A subroutine may look at anything; its force is taken to depend on the bodies it acts on, its
    slope of a state, and what a system of states puts out, on all bodies.
    """
    programs, nb = scene.programs, len(scene.bodies.mass)
    row_of = {int(offset): z for z, offset in enumerate(scene.states.offset)}
    bodies, states, user = [], [], []
    acts_on = _bodies_of_forces(scene)
    for k in range(len(programs.start) - 1):
        code = programs.code[programs.start[k] : programs.start[k + 1]]
        markers: set[int] = set()
        for row in code:
            markers.update(map(int, row[1 : 1 + _MARKERS.get(int(row[0]), 0)]))
            if row[0] == p.ANGLE:
                markers.update((int(scene.angles.i[row[1]]), int(scene.angles.j[row[1]])))
        # what a Force_Element gives has slopes of its own: linearization.element_slopes
        calls = any(row[0] == p.USER and scene.users.element[row[1]] < 0 for row in code)
        found = {int(scene.markers.body[m]) for m in markers}
        if calls:
            found |= acts_on.get(k, set())
            if any(row[0] == p.USER and row[3] == 1 for row in code):
                found |= set(range(nb))
        bodies.append(sorted(b for b in found if b < nb))
        looked = {row_of[int(row[1])] for row in code if row[0] == p.STATE}
        states.append(sorted(set(row_of.values()) if calls else looked))
        user.append(int(calls))
    return Depends(*_rows(bodies), *_rows(states), np.array(user, dtype=np.int64))


def _bodies_of_forces(scene: Scene) -> dict[int, set[int]]:
    """Return the bodies that forces act on, by their programs, and all by those of states."""
    found: dict[int, set[int]] = {}
    applied, body = scene.applied, scene.markers.body
    for f in range(len(applied.form)):
        both = {int(body[applied.i[f]]), int(body[applied.j[f]])}
        for program in (applied.program[f], *applied.components[f]):
            if program >= 0:
                found.setdefault(int(program), set()).update(both)
    everybody = set(range(len(scene.bodies.mass)))
    return found | {int(program): everybody for program in scene.states.program}


def _rows(lists: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
    """Return where each list begins in the numbers of all, and these."""
    lengths = [len(row) for row in lists]
    start = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    return start, np.array([k for row in lists for k in row], dtype=np.int64)

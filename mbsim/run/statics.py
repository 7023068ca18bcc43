"""Simulate analysis_type="Static": the search for an equilibrium at the time of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import CODE_OPERAND, CODE_OPERATION, JET_VALUE, WHOLE
from mbsim.compile_model.force_elements import STATEMENT
from mbsim.compile_model.instructions import USER
from mbsim.core import tags
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.initial.equilibrium import FAR_AWAY, MOST_ITERATIONS, Balance, Hooks, balance
from mbsim.dynamics.initial.equilibrium_states import Rest, settle_states
from mbsim.errors import SolverError
from mbsim.expressions.elementary import NUMBER, TIME
from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Simulation, Static
from mbsim.model.names import element_name

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.run.hook_calls import HookCalls

Array = np.ndarray[Any, Any]


@contextmanager
def standing_still(system: System, t: float) -> Iterator[None]:
    """Let TIME be a constant in all expressions, so that motions hold their displacements.

    Motions that give velocities or accelerations hold what they act on where it is. What users'
    motions give at that time becomes a constant of their equations.
    """
    programs, equations = system.scene.programs, system.scene.equations
    given, constants = equations.program.copy(), equations.constant.copy()
    rates = (given >= 0) & (equations.level < 2) & (equations.general != WHOLE)
    times = programs.code[:, CODE_OPERATION] == TIME
    kept = programs.code.copy()
    if times.any():
        programs.number[-1] = t
        programs.code[times, CODE_OPERATION] = NUMBER
        programs.code[times, CODE_OPERAND] = len(programs.number) - 1
    equations.program[rates] = -1
    for e in np.flatnonzero(equations.program >= 0):
        row = _motion_of_user(system, int(equations.program[e]))
        if row >= 0:
            equations.constant[e] += _given_at(system, row, t)
            equations.program[e] = -1
    try:
        yield
    finally:
        programs.code[...] = kept
        equations.program[...], equations.constant[...] = given, constants


def _motion_of_user(system: System, program: int) -> int:
    """Return the row of the MOTSUB that is a program, -1 for none."""
    programs = system.scene.programs
    code = programs.code[programs.start[program] : programs.start[program + 1]]
    only = len(code) == 1 and code[0, CODE_OPERATION] == USER
    return int(code[0, CODE_OPERAND]) if only else -1


def _given_at(system: System, row: int, t: float) -> float:
    """Return the displacement that a MOTSUB gives at time t."""
    results = system.scene.users.result[row]
    user = list(system.subroutines.values())[row]
    if user.called(t, results) != 0:
        from mbsim.plugins.guard import raise_failure

        raise_failure()
    return float(results[JET_VALUE])


def find(
    system: System,
    y: Array,
    t: float,
    hooks: Hooks,
    given: Static,
    tell: Callable[[str], None],
) -> None:
    """Put the bodies of `y` into an equilibrium at time t, with velocities 0, and states with them.

    Raises
    ------
    SolverError
        If there is none, or none is found; `y` stays as it was.
    """
    most = given.max_num_iter or MOST_ITERATIONS
    loose = _loose_states(system)
    with standing_still(system, t):
        found, where = balance(system.scene, y, hooks, most, given.imbalance)
        if len(loose):
            # bodies that rest while states stand still are a start, or else what was given
            start = where if found.balanced else y
            rest = settle_states(system.scene, start, hooks, most, loose)
            if rest.state >= 0:
                raise SolverError(_unsettled(system, rest, t))
            found, where = balance(system.scene, rest.y, hooks, most, given.imbalance)
    if not found.balanced:
        raise SolverError(_failure(system, found, t))
    for line in _report(system, found, y, where, t):
        tell(line)
    count = len(system.scene.states.program)
    if len(loose):
        tell(f"static: states at rest after {rest.iterations} iterations")
    if len(loose) < count:
        tell(f"static: {count - len(loose)} of {count} states are held as they are")
    y[...] = where


def _loose_states(system: System) -> Array:
    """Return the rows of the states that a static analysis lets go to rest."""
    held = [state.is_static_hold for state in system.model.differentials.values()]
    count = len(system.scene.states.program)
    return np.array([k for k in range(count) if k >= len(held) or not held[k]], dtype=np.int64)


def _share(found: Balance) -> str:
    """Return the residual in words."""
    return f"residual {found.residual:.3g}, {found.residual / found.scale:.3g} of the largest load"


def _report(system: System, found: Balance, before: Array, y: Array, t: float) -> list[str]:
    """Return what the log says of an equilibrium."""
    count = len(system.body_ids)
    n = BODY_SIZE * count
    shift = (y[:n] - before[:n]).reshape(-1, BODY_SIZE)[:, :3]
    shifts = np.linalg.norm(shift, axis=1)
    lines = [
        f"static at time {t:.9g}: {found.iterations} iterations, {found.evaluations} evaluations, "
        + _share(found)
    ]
    if count:
        b = int(shifts.argmax())
        lines.append(f"static: {system.body_name(b)} moved furthest, by {shifts[b]:.6g}")
    if found.unstable:
        lines.append("static: without friction this equilibrium is unstable")
    return lines


def _unsettled(system: System, rest: Rest, t: float) -> str:
    """Return which state has no equilibrium."""
    states = [("Control_Diff", id) for id in system.model.differentials]
    states += [
        (FORCES[STATEMENT].statement, id)
        for id, user in system.residuals.items()
        for _ in user.states
    ]
    name = element_name(system.model.file, *states[rest.state])
    return (
        f"no static equilibrium found at time {t:.9g}: the rate of {name} stays "
        f"{rest.rate:.6g} after {rest.iterations} iterations, which is not 0"
    )


def _failure(system: System, found: Balance, t: float) -> str:
    """Return why there is no equilibrium."""
    name = system.body_name(found.worst)
    if found.far:
        why = f"{name} went further than {FAR_AWAY:g} times the model's size: it rests on nothing"
    elif found.loose:
        why = f"nothing holds {name} against the force on it"
    else:
        why = f"the largest is on {name}"
    said = (
        f"no static equilibrium found at time {t:.9g} in {found.iterations} iterations: "
        f"{_share(found)}; {why}"
    )
    frictional = [id for id, c in system.model.contacts.items() if c.cff_type != "COULOMB_OFF"]
    if frictional:
        who = element_name(system.model.file, "Force_Contact", frictional[0])
        said += (
            f"; friction, as {who} has, does nothing in a Static: where friction alone keeps "
            "bodies from sliding off let a Transient bring them to rest"
        )
    return said


def balance_bodies(
    system: System,
    hooks: HookCalls,
    simulation: Simulation,
    at: Array,
    f: Array,
    tell: Callable[[str], None],
) -> None:
    """Put the bodies of the state `at` into equilibrium; `f` has its length, and is scratch."""
    t, problem, scene = simulation.start_time, hooks.problem, system.scene
    asked = Hooks(
        lambda y, f: hooks.call(problem.rhs, t, 0.0, y, f),
        lambda y: hooks.must(problem.project, t, y, y),
        lambda y, f: hooks.must(problem.commit, t, y, f),
        hooks.joints_at(t),
    )
    before = tags.copies(scene, tags.STATE)

    # there are no steps here that could end where friction changes
    scene.state.frozen[0] = 0
    y = at.copy()
    find(system, y, t, asked, simulation.static, tell)
    # turns are counted on the way; all else is as if the bodies had jumped
    turns = scene.state.angle.copy()
    tags.put_back(scene, tags.STATE, before)
    scene.state.angle[...] = turns
    at[...] = y
    for _ in range(2):
        # near pairs of large contacts are listed first, then looked at
        hooks.must(problem.rhs, t, at, f)
        hooks.must(problem.commit, t, at, f)

"""Why a run ends before its time, in the user's words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsim.arrays.codes import AT_FAULT, DRIFT, DRIFTER, WORST_BODY
from mbsim.core.codes import Code
from mbsim.errors import PluginError, SolverError
from mbsim.model.names import element_name

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.run.settings import Settings


def give_up(system: System, settings: Settings, method: Any) -> NoReturn:
    """Raise why the step became too small."""
    from mbsim.core import problem
    from mbsim.integrators import scheme

    memory, counts, diagnostics = (
        method.memory,
        method.counts,
        system.scene.work.diagnostics,
    )
    reason = {
        problem.BY_ERROR: f"its error stays {memory[scheme.LAST_ERROR]:.3g} times too large",
        problem.BY_CHECK: "an impact would begin deeper than its contact time allows",
        problem.BY_NOT_FINITE: "a force or acceleration is not finite",
        problem.BY_NEWTON: "Newton's iteration does not converge",
        problem.BY_JUMP: "",
    }[int(counts[scheme.LAST_REASON])]
    unsolved = counts[scheme.LAST_REASON] == problem.BY_NEWTON
    if unsolved:
        reason += _corrections(memory[scheme.CORRECTION_BEFORE], memory[scheme.CORRECTION])
    body, contact = int(diagnostics[WORST_BODY]), int(diagnostics[AT_FAULT])
    where = []
    by_body = unsolved or counts[scheme.LAST_REASON] == problem.BY_ERROR
    if by_body and 0 <= body < len(system.body_ids):
        where.append(system.body_name(body))
    where.extend(_out_of_reach(system, settings))
    if counts[scheme.LAST_REASON] == problem.BY_NOT_FINITE:
        where.extend(_not_finite(system)[:1])
        if not where and _is_nowhere(system):
            raise SolverError(_touches_nowhere(system, float(memory[scheme.TIME])))
    if 0 <= contact < len(system.contact_ids):
        where.append(f"Force_Contact[{system.contact_ids[contact]}]")
    elif unsolved:
        where.extend(_held_by(system, body))
    if counts[scheme.LAST_REASON] == problem.BY_JUMP:
        # the jump itself, whatever else it puts off
        now, jump = memory[scheme.TIME], float(system.scene.sweep.quality[DRIFT])
        times = jump / memory[scheme.TOL] if jump > 0.0 else memory[scheme.LAST_ERROR]
        raise SolverError(
            f"at time {now:.9g} a position or velocity jumps that joints and motions give, by "
            f"{times:.3g} times what a step's error may be: no step goes on; "
            f"at {', '.join(where) or 'no single element'}. Results up to there are kept."
        )
    raise SolverError(
        f"the step fell to {memory[scheme.STEP]:.3g} at time {memory[scheme.TIME]:.9g} "
        f"because {reason}; at {', '.join(where) or 'no single element'}. "
        "Results up to there are kept."
    )


def _corrections(before: float, last: float) -> str:
    """Return what is said of the last two corrections [parts of the scale that tol is of]."""
    if last == 0.0:
        return " (no correction was found: its linear equations are singular)"
    return f" (its last corrections were {before:.3g} and {last:.3g}, over the scale of tol)"


def _held_by(system: System, body: int) -> list[str]:
    """Return the joints and motions that hold a body."""
    scene = system.scene
    markers, ends = scene.markers.body, scene.connections
    found = []
    for row in range(len(system.connections)):
        ends_of = [int(m) for m in (ends.i[row], ends.j[row]) if m >= 0]
        if body in markers[ends_of]:
            found.append(system.connection_name(row))
    return found


def _out_of_reach(system: System, settings: Settings) -> list[str]:
    """Return the equation that the step tried last left by more than its error may be."""
    quality = system.scene.sweep.quality
    if not quality[DRIFT] > settings.tol:
        return []
    from mbsim.dynamics.initial.assembly import equation_name

    return [equation_name(system, int(quality[DRIFTER]))]


def _not_finite(system: System) -> list[str]:
    """Return the applied forces that were no numbers when last evaluated."""
    from mbsim.results.elements import GROUPS

    applied = system.scene.work.applied
    broken = np.flatnonzero(~np.isfinite(applied).all(axis=1))
    file = system.model.file
    elements = (system.applied[k] for k in broken)
    return [element_name(file, GROUPS[statement].title, id) for statement, id in elements]


_PLAIN: dict[int, str] = {
    Code.TOO_FAR: "shapes moved further in a step than is known of what is near them",
    Code.NO_ROOM: "more bodies act on each other than a linearisation has room for",
    Code.MANY_POINTS: "more contact points are in reach of a step than there is room for",
    Code.SINGULAR: "the linear equations of an implicit step have no solution",
}


def fail(system: System, detector: Any, code: int, t: float) -> NoReturn:
    """Raise what the hooks' code says."""
    if code in (Code.RAISED_INTERPRETED, Code.STOPPED_BY_USER):
        from mbsim.plugins import raise_failure

        raise_failure()
    contact = int(system.scene.work.diagnostics[AT_FAULT])
    if code == Code.CONTRADICTION:
        from mbsim.dynamics.initial.assembly import equation_name

        raise SolverError(
            f"{equation_name(system, contact)} contradicts other constraints from time "
            f"{t:.9g} on; results up to there are kept"
        )
    if code == Code.JAMMED:
        raise SolverError(_jammed(system, contact, t))
    if code == Code.UNSETTLED:
        raise SolverError(_unsettled(system, contact, t))
    if code == Code.UNSOLVED_ELEMENT:
        raise SolverError(_unsolved(system, t))
    element = system.contact_ids[contact] if 0 <= contact < len(system.contact_ids) else 0
    if code == Code.USER_NORMAL_FAILED:
        from mbsim.plugins.normal import reproduce_normal

        reproduce_normal(system.user_normal[element])
    if code in (Code.RAISED_COMPILED, Code.USER_NOT_FINITE) and element in system.user_friction:
        from mbsim.plugins import reproduce

        user = system.user_friction[element]
        if user.function is None:
            out = system.scene.work.law_out
            force = [float(out[k]) for k in (0, 1, 4)]
            raise PluginError(
                f"Force_Contact[{element}]: {user.name} failed at time {t:.12g}: returned {force}, "
                f"not 3 finite numbers [Fx, Fy, Tz] ({user.source}); nan is also what it left unset"
            )
        reproduce(system.user_friction[element], system.scene.work.law_in, element)
        raise PluginError(f"Force_Contact[{element}]: its subroutine failed at time {t:.12g}")
    if code == Code.END_OF_CURVE:
        raise SolverError(_at_end(system, t))
    if code == Code.NO_ONE_TOUCH:
        raise SolverError(_touches_nowhere(system, t))
    if code == Code.NOT_REPEATED:
        raise SolverError(_not_repeated(system, t))
    if code == Code.DETECTOR_FAILED and detector is not None:
        raise SolverError(f"FCL failed at time {t:.9g}: {detector.failure}")
    if code == Code.CROWDED:
        raise SolverError(
            f"at time {t:.9g} more pairs of graphics are near each other than there is room for"
        )
    if code in (Code.NOT_FINITE, Code.USER_NOT_FINITE):
        where = "".join(f" of {name}" for name in _not_finite(system)[:1])
        raise SolverError(f"a force or acceleration{where} is not finite at time {t:.9g}")
    why = _PLAIN.get(code, f"evaluation failed with code {code}")
    raise SolverError(f"{why} at time {t:.9g}")


def _not_repeated(system: System, t: float) -> str:
    """Return what is said where f is no function of time and state."""
    users = [
        f"Force_Contact[{element}]: {user.name} of {user.source}"
        for element, user in system.user_friction.items()
        if not user.compiled
    ]
    whose = f" ({'; '.join(users)})" if users else ""
    return (
        f"at time {t:.9g} forces differ each time they are asked for at the same time and "
        f"state: a user's function{whose} depends on more than its arguments, as on chance or a "
        "clock. An implicit method has nothing to solve then: take VERLET or DOPRI5. Results up to "
        "there are kept."
    )


def _jammed(system: System, row: int, t: float) -> str:
    """Return what is said of friction that no acceleration can bear."""
    id = system.applied[row][1]
    joint = system.model.joint_frictions[id].joint_id
    return (
        f"Force_JointFriction[{id}]: Constraint_Joint[{joint}] jams at time {t:.9g}: friction "
        "and the reaction that it causes raise each other without end; results up to there "
        "are kept"
    )


def _unsettled(system: System, row: int, t: float) -> str:
    """Return what is said of a force that no reactions agree with."""
    from mbsim.results.elements import GROUPS

    statement, id = system.applied[row]
    name = element_name(system.model.file, GROUPS[statement].title, id)
    return (
        f"{name} does not settle at time {t:.9g}: it follows from reactions that follow from it, "
        "and no value was found that agrees with both; results up to there are kept"
    )


def _unsolved(system: System, t: float) -> str:
    """Return what is said of an element whose residual is not made 0."""
    from mbsim.plugins.residual import title_of

    residuals = system.scene.residuals
    id = int(residuals.id[residuals.unsolved[0]])
    user = system.residuals[id]
    return (
        f"{title_of(system.model.force_elements[id])}: no unknowns ({', '.join(user.about())}) "
        f"were found that make the residual {user.name} of {user.source} 0 at time {t:.9g}: it may "
        "have no zero there, jump over it, or not depend on an unknown; results up to there are "
        "kept"
    )


def _at_end(system: System, t: float) -> str:
    """Return which higher pair has come to the end of a curve or surface."""
    scene = system.scene
    curves, along, equations = scene.curves, scene.state.along, scene.equations
    last = curves.first[1:] - 1
    alongside = along[: len(last)]
    out = (alongside < curves.begin[curves.first[:-1]]) | (
        alongside > curves.begin[last] + curves.length[last]
    )
    rows = np.flatnonzero(out & (curves.closed == 0) & (equations.off[curves.equation] == 0))
    if len(rows) > 0:
        pair = int(equations.connection[curves.equation[rows[0]]])
        what = ("its curve", "the curve of I", "the curve of J")[curves.touching[rows[0]]]
    else:
        surfaces = scene.surfaces
        low, high = surfaces.start, surfaces.start + surfaces.spans - 1
        foot = along[len(last) :].reshape(-1, 2)
        ends = surfaces.begin[high] + surfaces.length[high]
        left = ((foot < surfaces.begin[low]) | (foot > ends)) & (surfaces.closed == 0)
        holds = equations.off[surfaces.equation] == 0
        row = int(np.flatnonzero(left.any(axis=1) & holds)[0])
        pair, what = int(equations.connection[surfaces.equation[row]]), "its surface"
    return (
        f"{system.connection_name(pair)} comes to an end of {what} at time {t:.9g} and has "
        "nowhere to go; results up to there are kept"
    )


def _is_nowhere(system: System) -> bool:
    """Return whether the step that was tried last found no place for a higher pair that holds."""
    scene = system.scene
    curves, off, lost = scene.curves, scene.equations.off, np.isnan(scene.sweep.located)
    count = len(curves.closed)
    on_curves = lost[:count] & (curves.touching == 1) & (off[curves.equation] == 0)
    on_surfaces = lost[count:].reshape(-1, 2).any(axis=1) & (off[scene.surfaces.equation] == 0)
    return bool(on_curves.any() or on_surfaces.any())


def _touches_nowhere(system: System, t: float) -> str:
    """Return that a higher pair has no one point in which it touches."""
    of = ("CVCV", "PTSF")
    pairs = [k for k, (statement, _) in enumerate(system.connections) if statement in of]
    names = " or ".join(map(system.connection_name, pairs))
    return (
        f"{names}: no one point of contact at time {t:.9g}: none is found next to the last one, or "
        "curves are equally bent there, or a surface has no normal; results up to there are kept"
    )

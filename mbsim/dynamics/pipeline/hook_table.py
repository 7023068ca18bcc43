"""The table of a scene's hooks, in the order in which a step comes to them first.

Each row says what a hook is called with, what it does, when a scene has it and what its result
means; `fill` puts the addresses into `World.hooks`, and nothing else does, but for the detector,
which is Python (`run.simulation`). What a scene lacks is neither imported nor compiled.

y, dy (n,) are pointers to doubles, t is a double, all else int64; `context` is the packed scene.
Entries that share most of what they compile are one hook with requests (`arrays.hooks`).

A result is 0, or a `Code`, unless the row says otherwise: an answer is >= 0, or less a code. Every
caller returns the code or notes it (`arrays.hooks.note_failure`): a hook that fails ends the step,
and the run where a shorter step does not help.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from importlib import import_module
from typing import Any, NamedTuple

from mbsim.arrays.codes import MULTI_POINT, RESIDUAL, VECTOR_FORCE, WRENCH
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Tangent
from mbsim.core import jit
from mbsim.core.problem import HOOK
from mbsim.core.signature import COMPLEX_POINTER, FLOAT, INT, POINTER
from mbsim.geometry.catalog import REGION_ROWS

_AT = INT(INT, FLOAT, POINTER)  # context, t, y
_FORCES = INT(INT, FLOAT, POINTER, POINTER)  # context, t, y, dy
_KEEPS = INT(INT, INT, FLOAT, POINTER)  # context, request, t, y
_WRENCHES = frozenset((VECTOR_FORCE, WRENCH, RESIDUAL, MULTI_POINT))


class Method(NamedTuple):
    """What a method asks of a scene beside y'."""

    tangent: Tangent | None = None  # its linearisation, where it is implicit
    pair: bool = False  # in complex systems too


class Row(NamedTuple):
    """A hook."""

    hook: Hook
    signature: Any
    when: Callable[[Scene, Method], bool]  # whether a scene has it
    entry: Callable[[Scene], Callable[..., Any]]  # the C function that this scene needs
    does: str
    result: str = "0 or a code"


def _never(scene: Scene, method: Method) -> bool:
    return False  # Python puts it there


def _no_entry(scene: Scene) -> Callable[..., Any]:
    raise ValueError("this hook has no compiled function")


def _has_contacts(scene: Scene, method: Method) -> bool:
    return len(scene.contacts.id) > 0


def _of(module: str, name: str) -> Callable[[Scene], Callable[..., Any]]:
    """Return what finds a function that is the same in all scenes that have the hook."""

    def entry(scene: Scene) -> Callable[..., Any]:
        found: Callable[..., Any] = getattr(import_module(f"mbsim.dynamics.{module}"), name)
        return found

    return entry


def _any(table: str, column: str) -> Callable[[Scene, Method], bool]:
    """Return what says whether a column of a scene's table has any entry that is not 0."""
    return lambda scene, method: bool(getattr(getattr(scene, table), column).any())


def _rows(table: str, column: str) -> Callable[[Scene, Method], bool]:
    """Return what says whether a scene's table has rows."""
    return lambda scene, method: len(getattr(getattr(scene, table), column)) > 0


def _gauges(scene: Scene) -> Callable[..., Any]:
    from mbsim.dynamics.pipeline.contact_hooks import gauge_contacts, gauge_steps

    carries = (scene.slots.x >= 0).any() or (scene.slots.z >= 0).any()
    return gauge_contacts if carries else gauge_steps


def _has_faces(scene: Scene, method: Method) -> bool:
    return bool((scene.kinds.whole > 0.0).any())


def _spreads(scene: Scene, method: Method) -> bool:
    patches = scene.kinds.contact[scene.kinds.step == REGION_ROWS]
    return bool(scene.contacts.spreads[patches].any())


def _linearised(when: Callable[[Scene, Method], bool]) -> Callable[[Scene, Method], bool]:
    """Return what says whether a scene has something, and a method asks for its derivatives."""
    return lambda scene, method: method.tangent is not None and when(scene, method)


def _fixes_steps(scene: Scene, method: Method) -> bool:
    return _has_contacts(scene, method) and scene.world.fixed_step[0] == 1


def _needs_jets(scene: Scene, method: Method) -> bool:
    """Equations need them, and slopes of forces."""
    if (scene.equations.program >= 0).any():
        return True
    return _needs_slopes(scene, method) and len(scene.programs.start) > 1


def _has_applied(scene: Scene, method: Method) -> bool:
    acts = len(scene.applied.form) > 0 or len(scene.states.program) > 0
    return acts or bool((scene.world.weight >= 0).any())


def _applied(scene: Scene) -> Callable[..., Any]:
    from mbsim.dynamics.pipeline.force_hooks import act, drive_alone

    return act if len(scene.applied.form) > 0 else drive_alone


def _has_wrenches(scene: Scene, method: Method) -> bool:
    return not _WRENCHES.isdisjoint(scene.applied.form.tolist())


def _wrench(scene: Scene) -> Callable[..., Any]:
    """Return what adds the wrenches that there are, so that no other is compiled."""
    from mbsim.dynamics.pipeline import force_hooks as of

    forms = set(scene.applied.form.tolist())
    if MULTI_POINT in forms:
        return of.act_by_any_wrench
    if WRENCH in forms:
        return of.act_by_wrench if forms & {VECTOR_FORCE, RESIDUAL} else of.act_by_marker_force
    return of.act_by_vector_force


def _joints(scene: Scene) -> Callable[..., Any]:
    """Return what joints do; a tree alone compiles no equations."""
    from mbsim.dynamics.pipeline.joint_hooks import serve_joints, serve_tree

    settles = bool(scene.applied.with_reactions.any())
    return serve_joints if len(scene.equations.program) > 0 or settles else serve_tree


def _has_reaction_forces(scene: Scene, method: Method) -> bool:
    return len(scene.applied.by_reactions) > 0 or bool((scene.applied.connection >= 0).any())


def _reaction_forces(scene: Scene) -> Callable[..., Any]:
    from mbsim.dynamics.pipeline.force_hooks import add_joint_friction, settle

    # forces by reactions are compiled with all that they need
    return settle if len(scene.applied.by_reactions) > 0 else add_joint_friction


def _bend(scene: Scene) -> Callable[..., Any]:
    from mbsim.dynamics.pipeline.implicit_hooks import bend, bend_and_drive

    return bend_and_drive if (scene.equations.level < 2).any() else bend


def _has_memory(scene: Scene, method: Method) -> bool:
    return method.tangent is not None and len(method.tangent.keeps.table) > 0


def _needs_slopes(scene: Scene, method: Method) -> bool:
    return method.tangent is not None and len(scene.applied.form) + len(scene.states.program) > 0


def _slopes(scene: Scene) -> Callable[..., Any]:
    forms = set(scene.applied.form.tolist())
    from mbsim.dynamics.pipeline import implicit_hooks as of

    if MULTI_POINT in forms or RESIDUAL in forms:
        return of.all_slopes if MULTI_POINT in forms else of.residual_slopes
    has_friction = bool((scene.applied.connection >= 0).any())
    if WRENCH in forms:
        return of.slopes_with_both if has_friction else of.slopes_with_marker_forces
    return of.slopes_with_joint_friction if has_friction else of.slopes


def _has_dry(scene: Scene, method: Method) -> bool:
    keeps = scene.applied.keeps.any() or scene.contacts.rigid.any()
    return bool(keeps) or len(scene.residuals.id) > 0


def _dry(scene: Scene) -> Callable[..., Any]:
    """Return what keeps of a step what there is: elements, dry friction, rigid friction."""
    rigid = bool((scene.applied.equation >= 0).any() or scene.contacts.rigid.any())
    from mbsim.dynamics.pipeline import force_hooks as of

    if len(scene.residuals.id) > 0:
        if rigid:
            return of.keep_with_rigid
        dry = scene.applied.keeps.any()
        return of.keep_with_dry if dry else of.keep_elements
    return of.serve_rigid_alone if rigid else of.serve_dry_alone


def _has_pairs(scene: Scene) -> bool:
    return len(scene.curves.i) + len(scene.surfaces.i) > 0


def _has_ways(scene: Scene, method: Method) -> bool:
    return len(scene.angles.i) > 0 or _has_pairs(scene)


TABLE = (
    # evaluation
    Row(
        Hook.CONTACTS,
        INT(INT, INT, FLOAT, FLOAT, POINTER, POINTER),  # context, request, t, h, y, y' or energies
        _has_contacts,
        _of("pipeline.contact_hooks", "serve_contacts"),
        "does what contacts are asked for: `Contacts`",
        "an answer, or less a code",
    ),
    Row(
        Hook.FCL,
        INT(INT),  # how many pairs of `Work.fcl`
        _never,
        _no_entry,
        "writes the points of pairs without a closed form; a scene with such a pair has it",
    ),
    Row(
        Hook.SLOTS,
        INT(INT, INT),  # context, pair
        _any("kinds", "moves"),
        _of("pipeline.contact_hooks", "keep_slots_of"),
        "puts incidents that have no identity of their own into the slots that they had",
    ),
    Row(
        Hook.TILTING,
        INT(INT, INT, FLOAT, FLOAT, POINTER),  # context, slot, t, normal force, y
        _has_faces,
        _of("pipeline.contact_hooks", "damp_contact"),
        "finds the couple against tilting of a flat face that is one incident",
    ),
    Row(
        Hook.RECALL,
        INT(INT, INT, INT, FLOAT, POINTER, INT),  # context, request, slot, t, y or y', 1 for anew
        _any("contacts", "memory"),
        _of("pipeline.contact_hooks", "recall_friction"),
        "does what friction of contacts with memory is asked for: `Recall`",
        "an answer, or less a code",
    ),
    Row(
        Hook.SPREAD,
        INT(INT, INT, INT),  # context, slot, contact
        _spreads,
        _of("pipeline.contact_hooks", "friction_of_patch"),
        "asks a friction law all over a patch",
    ),
    Row(
        Hook.RIM,
        INT(INT, INT, INT),  # context, slot, contact
        _any("contacts", "rims"),
        _of("pipeline.contact_hooks", "friction_of_rim"),
        "asks a friction law all round the rim that a body stands on",
    ),
    Row(
        Hook.HOLD_BACK,
        INT(INT, INT, FLOAT, FLOAT, FLOAT, POINTER),  # context, slot, h, slip along x and y, y
        _fixes_steps,
        _of("pipeline.contact_hooks", "hold_friction_back"),
        "reduces friction to what a step of fixed length can follow",
        "0; it cannot fail",
    ),
    Row(
        Hook.VALUE,
        FLOAT(INT, FLOAT, POINTER, INT),  # context, t, y, program
        lambda scene, method: len(scene.programs.start) > 1,
        _of("pipeline.force_hooks", "evaluate_expression"),
        "evaluates an expression",
        "the value; a user's subroutine that fails notes its code, and the value is nan",
    ),
    Row(
        Hook.JET,
        INT(INT, FLOAT, POINTER, INT, INT, INT),  # context, t, y, program, body, direction
        _needs_jets,
        _of("pipeline.force_hooks", "express"),
        "leaves an expression and its rates in the first row of `Programs.stack`",
    ),
    Row(
        Hook.APPLIED,
        _FORCES,
        _has_applied,
        _applied,
        "adds forces between markers and gravity over time, and the slopes of states",
    ),
    Row(
        Hook.WRENCH,
        INT(INT, FLOAT, POINTER, INT),  # context, t, y, row of `Applied`
        _has_wrenches,
        _wrench,
        "adds a marker force or a vector force",
    ),
    Row(
        Hook.ELEMENT,
        INT(INT, FLOAT, POINTER, INT, INT),  # context, t, y, element, component
        _rows("residuals", "id"),
        _of("pipeline.force_hooks", "serve_element"),
        "solves a Force_Element for what expressions ask of it",
    ),
    Row(
        Hook.JOINTS,
        INT(INT, INT, FLOAT, POINTER, POINTER),  # context, request, t, y, dy
        _rows("tree", "body"),
        _joints,
        "does what joints are asked for: `Joints`",
    ),
    Row(
        Hook.STICKING,
        _KEEPS,
        _any("contacts", "rigid"),
        _of("pipeline.force_hooks", "serve_sticking_contacts"),
        "does what contacts are asked for whose friction is rigid: `Sticking`",
        "an answer, or less a code",
    ),
    Row(
        Hook.HIGHER_PAIRS,
        INT(INT, INT, INT, POINTER),  # context, term, 1 to find anew where it touches, y
        lambda scene, method: _has_pairs(scene),
        _of("pipeline.force_hooks", "fill_higher_pair"),
        "fills a term of an equation of a higher pair",
        "0; it cannot fail",
    ),
    Row(
        Hook.RELATIONS,
        INT(INT, FLOAT, POINTER, INT),  # context, t, y, equation
        _any("equations", "user"),
        _of("pipeline.force_hooks", "relate_terms"),
        "makes the sum of an equation's terms a user's relation of them",
    ),
    Row(
        Hook.LOOPS,
        _KEEPS,
        _rows("graph", "tree"),
        _of("loops.hook", "serve_loops"),
        "does what many loops are asked for: `Loops`",
        "0; it cannot fail",
    ),
    Row(
        Hook.REACTION_FORCES,
        _FORCES,
        _has_reaction_forces,
        _reaction_forces,
        "finds forces that follow from reactions, and the accelerations with them",
    ),
    Row(
        Hook.EVALUATE,
        HOOK,
        lambda scene, method: True,
        _of("pipeline.hooks", "rhs"),
        "evaluates y' at a point that is no step's: of a row, within one, of another branch",
    ),
    # linearisation
    Row(
        Hook.BEND,
        _AT,
        _linearised(_rows("equations", "program")),
        _bend,
        "adds how forces of equations turn with the bodies",
    ),
    Row(
        Hook.CONTACT_SLOPES,
        INT(INT, INT, FLOAT, FLOAT, POINTER),  # context, request, t, h, y
        _linearised(_has_contacts),
        _of("pipeline.implicit_hooks", "slopes_of_contacts"),
        "does what derivatives of contacts are asked for: `ContactSlopes`",
    ),
    Row(
        Hook.FACE_SLOPES,
        FLOAT(INT, INT, INT, FLOAT, FLOAT, POINTER),  # context, request, slot, two numbers, y
        _linearised(_has_faces),
        _of("pipeline.implicit_hooks", "slopes_of_faces"),
        "does what derivatives of flat faces are asked for that are one incident: `FaceSlopes`",
        "a number; it cannot fail",
    ),
    Row(
        Hook.MEMORY,
        INT(INT, INT, POINTER, POINTER),  # context, request, r, d
        _has_memory,
        _of("linearization.memory_slopes", "serve_memory"),
        "does what friction with memory is asked for in real systems: `Memory`",
    ),
    Row(
        Hook.SLOPES,
        _AT,
        _needs_slopes,
        _slopes,
        "adds the derivatives of forces between markers and of the slopes of states",
    ),
    Row(
        Hook.MEMORY_PAIR,
        INT(INT, INT, COMPLEX_POINTER, COMPLEX_POINTER),
        lambda scene, method: _has_memory(scene, method) and method.pair,
        _of("linearization.memory_slopes", "serve_memory_pair"),
        "does the same in complex systems",
    ),
    # a step is taken
    Row(
        Hook.GAUGES,
        FLOAT(INT, INT, FLOAT, FLOAT, POINTER, POINTER),  # context, request, t, h, error, y
        _has_contacts,
        _gauges,
        "measures contacts: `Gauges`",
        "the measure; a failure is noted",
    ),
    Row(
        Hook.EFFECTS,
        FLOAT(INT, INT, FLOAT, FLOAT, POINTER, POINTER),  # context, request, t, h, error, y
        _linearised(_has_contacts),
        _of("pipeline.contact_hooks", "measure_effects"),
        "measures what an error does to contacts: `Effects`; of explicit methods nothing knows it",
        "the measure; a failure is noted",
    ),
    Row(
        Hook.STABILITY,
        FLOAT(INT, INT, POINTER, POINTER),  # context, request, y, y'
        _fixes_steps,
        _of("pipeline.contact_hooks", "bound_contacts"),
        "bounds steps of a method without error estimate: `Stability`",
        "a step or 0; laws are explored, so that it does not fail",
    ),
    Row(
        Hook.PASSING,
        FLOAT(INT, INT, FLOAT, POINTER, POINTER),  # context, pair, the time asked for, y, y'
        lambda scene, method: bool(scene.kinds.bound.any()),
        _of("pipeline.contact_hooks", "bound_passing"),
        "finds how long a pair of a mesh that touches passes through no wall",
        "a time; it cannot fail",
    ),
    Row(
        Hook.FCL_POINTS,
        FLOAT(INT, INT, INT, FLOAT, POINTER),  # context, request, slot or pair, h, y
        lambda scene, method: bool((scene.kinds.kernel == 0).any()),
        _of("pipeline.contact_hooks", "serve_fcl_points"),
        "looks at points of pairs without a closed form: `FclPoints`",
        "a number; it cannot fail",
    ),
    Row(
        Hook.DRY,
        _KEEPS,
        _has_dry,
        _dry,
        "keeps what dry friction and Force_Elements do in a step: `Dry`",
        "an answer, or less a code",
    ),
    Row(
        Hook.ANGLES,
        INT(INT, POINTER),  # context, y
        _has_ways,
        lambda of: _of("pipeline.force_hooks", ("commit_turns", "commit_ways")[_has_pairs(of)])(of),
        "counts the turns of angles, and follows higher pairs",
    ),
    Row(
        Hook.NEAR,
        INT(INT, POINTER),  # context, y
        _rows("broadphase", "contact"),
        _of("pipeline.hooks", "list_near"),
        "lists near pairs anew where shapes have moved far enough",
    ),
    # a row is written
    Row(
        Hook.REQUESTS,
        _AT,
        lambda scene, method: scene.rows.value.shape[1] > 0,
        _of("pipeline.force_hooks", "evaluate_requests"),
        "evaluates the expressions of requests",
    ),
)


def fill(scene: Scene, method: Method | None = None, only: Container[Hook] | None = None) -> None:
    """Put the hooks that a scene and a method need into `World.hooks`, those of `only` if given."""
    method = method or Method()
    for row in TABLE:
        if (only is None or row.hook in only) and row.when(scene, method):
            _put(scene, row)


def put(scene: Scene, *hooks: Hook) -> None:
    """Put hooks into `World.hooks` that are not there yet."""
    for row in (row for row in TABLE if row.hook in hooks):
        _put(scene, row)


def _put(scene: Scene, row: Row) -> None:
    # what was only counted, to say how much is to be compiled, is not there either
    if scene.world.hooks[row.hook] in (0, jit.NOT_YET):
        scene.world.hooks[row.hook] = jit.address(row.entry(scene), row.signature)

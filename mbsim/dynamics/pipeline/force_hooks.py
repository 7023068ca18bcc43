"""Hooks of applied forces, elements, expressions, followed angles and friction that is held."""

from __future__ import annotations

from mbsim.arrays.codes import FOLD_HALT
from mbsim.arrays.hooks import Gauges, Hook, failure_or, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.angles import commit_angles, longest_turn
from mbsim.dynamics.expressions.interpreter import interpret
from mbsim.dynamics.expressions.jets import fill_values
from mbsim.dynamics.expressions.relations import relate
from mbsim.dynamics.expressions.states import add_slopes
from mbsim.dynamics.expressions.values import evaluate_program
from mbsim.dynamics.forces.applied import add_applied, serve_kept
from mbsim.dynamics.forces.force_element import keep_residuals, serve_residual
from mbsim.dynamics.forces.gravity import add_weight
from mbsim.dynamics.forces.joint_friction import add_friction
from mbsim.dynamics.forces.multi_point import add_any_wrench
from mbsim.dynamics.forces.reaction_forces import add_reaction_forces
from mbsim.dynamics.forces.wrenches import add_marker_force, add_vector_force, add_wrench
from mbsim.dynamics.higher_pairs.serve import commit_pairs, fill_pair
from mbsim.dynamics.stiction.rigid_contact import serve_sticking
from mbsim.dynamics.stiction.rigid_friction import serve_rigid


@jitable
def drive(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Add gravity over time and fill the slopes of states; return 0 or a code."""
    add_weight(scene, t, y, dy)
    return failure_or(scene, add_slopes(scene, t, y, dy))


def drive_alone(context: int, t: float, y: Pointer, dy: Pointer) -> int:
    """What acts where there are no forces between markers."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return drive(scene, t, vector_at(y, n), vector_at(dy, n))


def act(context: int, t: float, y: Pointer, dy: Pointer) -> int:
    """The forces between markers, and the same."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    a, b = vector_at(y, n), vector_at(dy, n)
    code = failure_or(scene, add_applied(scene, t, a, b))
    return code if code != 0 else drive(scene, t, a, b)


def act_by_marker_force(context: int, t: float, y: Pointer, f: int) -> int:
    """A marker force."""
    scene = view(context, Scene)
    return add_marker_force(scene, vector_at(y, scene.rows.y.shape[1]), f)


def act_by_vector_force(context: int, t: float, y: Pointer, f: int) -> int:
    """A vector force."""
    scene = view(context, Scene)
    return add_vector_force(scene, t, vector_at(y, scene.rows.y.shape[1]), f)


def act_by_wrench(context: int, t: float, y: Pointer, f: int) -> int:
    """One or the other, where a scene has both."""
    scene = view(context, Scene)
    return add_wrench(scene, t, vector_at(y, scene.rows.y.shape[1]), f)


def act_by_any_wrench(context: int, t: float, y: Pointer, f: int) -> int:
    """Any, where a scene has forces of several markers."""
    scene = view(context, Scene)
    return add_any_wrench(scene, t, vector_at(y, scene.rows.y.shape[1]), f)


def add_joint_friction(context: int, t: float, y: Pointer, dy: Pointer) -> int:
    """Friction in joints, and the accelerations with it."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_friction(scene, t, vector_at(y, n), vector_at(dy, n))


def settle(context: int, t: float, y: Pointer, dy: Pointer) -> int:
    """Forces that need reactions, with friction in joints, and the accelerations with them."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_reaction_forces(scene, t, vector_at(y, n), vector_at(dy, n))


def express(context: int, t: float, y: Pointer, program: int, body: int, direction: int) -> int:
    """The jet of an expression."""
    scene = view(context, Scene)
    return interpret(scene, t, vector_at(y, scene.rows.y.shape[1]), program, body, direction)


def evaluate_expression(context: int, t: float, y: Pointer, program: int) -> float:
    """The value of an expression."""
    scene = view(context, Scene)
    return evaluate_program(scene, t, vector_at(y, scene.rows.y.shape[1]), program)


def evaluate_requests(context: int, t: float, y: Pointer) -> int:
    """The expressions of requests at an output row."""
    scene = view(context, Scene)
    return failure_or(scene, fill_values(scene, t, vector_at(y, scene.rows.y.shape[1])))


def commit_turns(context: int, y: Pointer) -> int:
    """The angles of the committed state."""
    return commit_angles(view(context, Scene))


def commit_ways(context: int, y: Pointer) -> int:
    """The same, and where higher pairs touch."""
    scene = view(context, Scene)
    commit_angles(scene)
    return commit_pairs(scene, vector_at(y, scene.rows.y.shape[1]))


def fill_higher_pair(context: int, k: int, anew: int, y: Pointer) -> int:
    """A term of an equation of a higher pair."""
    scene = view(context, Scene)
    fill_pair(scene, k, anew, vector_at(y, scene.rows.y.shape[1]))
    return 0


def relate_terms(context: int, t: float, y: Pointer, e: int) -> int:
    """An equation that is a user's relation of its terms."""
    scene = view(context, Scene)
    return relate(scene, t, vector_at(y, scene.rows.y.shape[1]), e)


def serve_dry_alone(context: int, what: int, t: float, y: Pointer) -> int:
    """What dry friction keeps of an accepted step, and what it holds."""
    scene = view(context, Scene)
    return serve_kept(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def serve_rigid_alone(context: int, what: int, t: float, y: Pointer) -> int:
    """The same where some is rigid."""
    scene = view(context, Scene)
    return serve_rigid(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def serve_sticking_contacts(context: int, what: int, t: float, y: Pointer) -> int:
    """What contacts do whose friction is rigid."""
    scene = view(context, Scene)
    return serve_sticking(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def limit_turn(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The step that lets nothing pass through anything and no angle lose count of its turns."""
    scene = view(context, Scene)
    longest = h
    if scene.world.hooks[Hook.GAUGES] != 0:
        longest = call_float(scene.world.hooks[Hook.GAUGES], (scene, Gauges.STEP, t, h, a, b))
    turn, halt = longest_turn(scene, abs(longest)), scene.sweep.quality[FOLD_HALT]
    if halt > t:
        turn = min(turn, halt - t)
    return turn if turn < abs(longest) else longest


def serve_element(context: int, t: float, y: Pointer, element: int, component: int) -> int:
    """What an element gives."""
    scene = view(context, Scene)
    return serve_residual(scene, t, vector_at(y, scene.rows.y.shape[1]), element, component)


def keep_elements(context: int, what: int, t: float, y: Pointer) -> int:
    """What elements keep of an accepted step."""
    scene = view(context, Scene)
    return keep_residuals(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def keep_with_dry(context: int, what: int, t: float, y: Pointer) -> int:
    """The same, and what dry friction keeps."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    note_failure(scene, keep_residuals(scene, what, t, a))
    return serve_kept(scene, what, t, a)


def keep_with_rigid(context: int, what: int, t: float, y: Pointer) -> int:
    """The same where some is rigid."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    note_failure(scene, keep_residuals(scene, what, t, a))
    return serve_rigid(scene, what, t, a)

"""Whether joints, couplers, motions, forces and their expressions make sense in their model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

from mbsim.errors import Fault
from mbsim.expressions import Expression
from mbsim.expressions.functions import FUNCTIONS, SPLINE_POINTS, Kind
from mbsim.expressions.tree import Call, Number
from mbsim.forces.catalog import COMPONENTS, FORCES, Components, of_form
from mbsim.joints.catalog import JOINTS
from mbsim.model.elements import Model, Motion, Source

#: What has an id, as functions and requests of elements call it, with its statement.
STATEMENTS = {
    "marker": "Reference_Marker",
    "JOINT": "Constraint_Joint",
    "JPRIM": "Constraint_Jprim",
    "MOTION": "Motion_Joint",
    "PTCV": "Constraint_PTCV",
    "CVCV": "Constraint_CVCV",
    "PTSF": "Constraint_PTSF",
    **{name: FORCES[name].statement for name in FORCES},
    "CONTACT": "Force_Contact",
    "VARIABLE": "Reference_Variable",
    "DIFF": "Control_Diff",
    "SPLINE": "Reference_Spline",
    "ARRAY": "Reference_Array",
    "SENSOR": "Sensor_Event",
}
_DIRECTIONS = {"R": "turn about", "T": "slide along"}
#: Joints that may have friction, with the attribute that is the lever of what turns.
_LEVERS = {
    "REVOLUTE": "pin_radius",
    "TRANSLATIONAL": "",
    "CYLINDRICAL": "pin_radius",
    "SPHERICAL": "ball_radius",
}

#: Attributes that name markers.
_MARKERS = (
    "i_marker_id",
    "j_marker_id",
    "j_floating_marker_id",
    "ref_marker_id",
    "start_marker_id",
    "i_start_marker_id",
    "j_start_marker_id",
)

#: Fields of `Model` with elements of this module, before forces and behind them.
_CONSTRAINTS = {
    "Constraint_Joint": "joints",
    "Constraint_Jprim": "primitives",
    "Constraint_Coupler": "couplers",
    "Constraint_General": "general_constraints",
    "Constraint_PTCV": "points_on_curves",
    "Constraint_CVCV": "curves_on_curves",
    "Constraint_PTSF": "points_on_surfaces",
    "Motion_Joint": "motions",
}
_OTHERS = {
    "Reference_Variable": "variables",
    "Control_Diff": "differentials",
    "Reference_Spline": "splines",
    "Reference_ParamCurve": "curves",
    "Reference_ParamSurface": "surfaces",
    "Reference_Array": "arrays",
    "Sensor_Event": "sensors",
    "Sensor_Evaluate": "evaluations",
}

Wanted = tuple[Source, str, str, int | None, str]
Exists = Callable[[str, int], bool]


def tables(model: Model) -> dict[str, Mapping[int, Any]]:
    """Return the elements of this module by statement and id."""
    return {statement: model.table(name) for statement, name in _names()}


def filled(model: Model) -> Iterator[tuple[str, Mapping[int, Any]]]:
    """Yield the tables that have elements: most of them have none."""
    for statement, name in _names():
        if table := model.table(name):
            yield statement, table


@cache
def _names() -> tuple[tuple[str, str], ...]:
    forces = ((FORCES[name].statement, name) for name in FORCES)
    return (*_CONSTRAINTS.items(), *forces, *_OTHERS.items())


def name_of(statement: str, element: Any) -> str:
    """Return an element's name in messages; motions are of two statements."""
    return f"{getattr(element, 'statement', statement)}[{element.id}]"


def wanted(model: Model) -> Iterator[Wanted]:
    """Yield every reference: where, from which element and attribute, to which id and statement."""
    for statement, table in filled(model):
        for element in table.values():
            name = name_of(statement, element)
            # a motion of a joint has the joint's markers
            if getattr(element, "joint_id", None) is None:
                for attribute in _MARKERS:
                    id = getattr(element, attribute, 0) or None
                    yield element.source, name, attribute, id, "Reference_Marker"
            else:
                yield element.source, name, "joint_id", element.joint_id or None, "Constraint_Joint"
            for id in getattr(element, "joint_ids", ()):
                yield element.source, name, "joint_ids", id, "Constraint_Joint"
    for statement, pairs, attributes in (
        ("Constraint_PTCV", model.points_on_curves, ("curve_id",)),
        ("Constraint_CVCV", model.curves_on_curves, ("i_curve_id", "j_curve_id")),
        ("Constraint_PTSF", model.points_on_surfaces, ("surface_id",)),
    ):
        for pair in pairs.values():
            for attribute in attributes:
                id = getattr(pair, attribute) or None
                name = f"{statement}[{pair.id}]"
                kind = "Surface" if attribute == "surface_id" else "Curve"
                yield pair.source, name, attribute, id, f"Reference_Param{kind}"
    for request in model.requests.values():
        if request.elem_type and request.elem_id:
            statement = STATEMENTS[request.elem_type]
            name = f"Post_Request[{request.id}]"
            yield request.source, name, "elem_id", request.elem_id, statement
    for sensor in model.sensors.values():
        name = f"Sensor_Event[{sensor.id}]"
        yield sensor.source, name, "evaluate_id", sensor.evaluate_id, "Sensor_Evaluate"
    for source, name, attribute, expression in expressions(model):
        for id, statement in _used(expression):
            yield source, name, attribute, id, _other_statement(model, id, statement)


def _other_statement(model: Model, id: int, statement: str) -> str:
    """Return of which statement an expression's id is, where several share a function."""
    if statement == "Sensor_Event" and model.evaluations:
        return "Sensor_Evaluate"
    alone = id in model.body_forces and id not in model.vector_forces
    return "Force_Vector_OneBody" if alone and statement == "Force_Vector_TwoBody" else statement


def expressions(model: Model) -> Iterator[tuple[Source, str, str, Expression]]:
    """Yield every expression of the model: where, of which element and attribute."""
    for statement, table in filled(model):
        for element in table.values():
            expression = getattr(element, "expr", None)
            if expression is not None:
                yield element.source, name_of(statement, element), "expr", expression
    for kind in of_form(Components):
        for force in model.table(kind.name).values():
            for attribute, expression in zip(COMPONENTS, force.exprs, strict=True):
                if expression is not None:
                    yield force.source, f"{kind.statement}[{force.id}]", attribute, expression
    for sensor in model.sensors.values():
        if sensor.evaluate is not None and sensor.evaluate_id is None:
            yield sensor.source, f"Sensor_Event[{sensor.id}]", "evaluate", sensor.evaluate
    for request in model.requests.values():
        for k, expression in enumerate(request.exprs, start=1):
            if expression is not None:
                yield request.source, f"Post_Request[{request.id}]", f"expr{k}", expression


def _calls(expression: Expression) -> Iterator[Call]:
    """Yield every function of an expression."""
    rest = [expression.root]
    while rest:
        node = rest.pop()
        if isinstance(node, Call):
            yield node
            rest.extend(node.args)


def _used(expression: Expression) -> Iterator[tuple[int, str]]:
    """Yield the ids that an expression names, with their statement; marker 0 is always there."""
    for call in _calls(expression):
        kinds = FUNCTIONS[call.name].args if call.name in FUNCTIONS else ()
        for what, node in zip(kinds, call.args, strict=False):
            if what in STATEMENTS and isinstance(node, Number):
                if node.value != 0.0 or what != "marker":
                    yield int(node.value), STATEMENTS[what]


def check_mechanism(model: Model, exists: Exists) -> Iterator[Fault]:
    """Yield what is wrong with the joints, motions, couplers, forces and expressions of a model.

    Parameters
    ----------
    model : Model
        The deck as read.
    exists : callable
        Whether a (statement, id) is in the deck with a fault of its own.
    """
    yield from _two_bodies(model)
    yield from _motions(model, exists)
    yield from _couplers(model)
    yield from _frictions(model)
    yield from _limits(model)
    yield from _weights(model)
    yield from _circles(model)
    yield from _tables(model)


def _fault(source: Source, element: str, message: str) -> Fault:
    return Fault(source.file, source.line, element, message)


def _two_bodies(model: Model) -> Iterator[Fault]:
    """Yield constraints and forces whose markers are on one body, or on ground both."""
    ground = {body.id for body in model.bodies.values() if body.is_ground}
    for statement, table in filled(model):
        for element in table.values():
            if getattr(element, "joint_id", None) is not None:
                continue
            other = getattr(element, "j_marker_id", getattr(element, "j_floating_marker_id", 0))
            i, j = (model.markers.get(id) for id in (getattr(element, "i_marker_id", 0), other))
            if i is None or j is None:
                continue
            both = f"markers {i.id} (I) and {j.id} (J)"
            name = name_of(statement, element)
            if i.body_id == j.body_id:
                message = f"{both} are both on body {i.body_id}; must be on two bodies"
                yield _fault(element.source, name, message)
            elif {i.body_id, j.body_id} <= ground:
                message = f"{both} are both on ground; one must be on a body that moves"
                yield _fault(element.source, name, message)


def _allowed(type: str, what: str) -> str:
    """Return a joint's type and in words which directions a motion or a limit of it may have."""
    moves = JOINTS[type].moves
    if not moves:
        return f"{type}, which takes no {what}"
    return f"{type}; a {what} of it may be {' or '.join(moves)}"


def _motions(model: Model, exists: Exists) -> Iterator[Fault]:
    """Yield motions that their joint does not allow, that are repeated, or look at too much."""
    first: dict[tuple[Any, ...], int] = {}
    for motion in model.motions.values():
        if exists("Motion_Joint", motion.id):
            continue
        name = name_of("Motion_Joint", motion)
        joint = model.joints.get(motion.joint_id or 0)
        if joint is not None and motion.direction not in JOINTS[joint.type].moves:
            given = f'motion_type="{motion.direction}"' if motion.direction else "motion_type"
            message = f"{given}: joint {joint.id} is {_allowed(joint.type, 'motion')}"
            yield _fault(motion.source, name, message)
            continue
        if joint is not None or motion.joint_id is None:
            of = (motion.joint_id, motion.i_marker_id, motion.j_marker_id, motion.direction)
            if of in first:
                message = f"motion {first[of]} gives the same direction of the same "
                message += f"joint {motion.joint_id}" if joint else "markers"
                yield _fault(motion.source, name, f"{message}; must be given once")
            first.setdefault(of, motion.id)
        if motion.expr is not None and (message := _not_of_motion(model, motion)):
            yield _fault(motion.source, name, f'expr="{_short(motion.expr.text)}": {message}')


def _not_of_motion(model: Model, motion: Motion) -> str:
    """Return what of an expression cannot be given to a motion, and what can; or nothing."""
    assert motion.expr is not None
    allowed, what = {*_OF_POSES}, "of TIME and displacements"
    if motion.val_type == "A":
        allowed.add(Kind.VELOCITY)
        what = "of TIME, displacements and velocities"
    for call, through in looked_at(model, motion.expr):
        kind = FUNCTIONS[call.name].kind
        if kind not in allowed:
            given = {"D": "displacement", "V": "velocity", "A": "acceleration"}[motion.val_type]
            where = f" in {through}" if through else ""
            return (
                f"uses {call.name}{where}, which looks at {kind.value}; a motion that gives "
                f"the {given} must be an expression {what}"
            )
    return ""


def looked_at(model: Model, expression: Expression) -> Iterator[tuple[Call, str]]:
    """Yield what an expression looks at beyond TIME, by variables too, and by which of these."""
    waiting, seen = [(expression, "")], set[tuple[str, int]]()
    while waiting:
        now, through = waiting.pop()
        for call in _calls(now):
            if call.name in FUNCTIONS and FUNCTIONS[call.name].kind not in _OF_TIME:
                yield call, through
        for key in _put_in(now):
            table: Mapping[int, Any] = (
                model.variables if key[0] == "VARVAL" else model.differentials
            )
            if key not in seen and key[1] in table:
                seen.add(key)
                waiting.append((table[key[1]].expr, f"{key[0]}({key[1]})"))


def _weights(model: Model) -> Iterator[Fault]:
    """Yield gravity that depends on more than TIME."""
    seen: list[Expression] = []
    for gravity in (model.gravity, *(stage.gravity for stage in model.simulations)):
        for axis, expression in zip("xyz", gravity.exprs if gravity else (), strict=False):
            if expression is None or any(expression is other for other in seen):
                continue
            seen.append(expression)
            if gravity is not None and (other := _not_of_time(expression)):
                message = f'grav_{axis}="{_short(expression.text)}": uses {other}; must be '
                message += "a number or an expression of TIME"
                yield _fault(gravity.source, "Force_Gravity", message)


def _not_of_time(expression: Expression) -> str:
    """Return the first function of an expression that depends on the state, or nothing."""
    names = (call.name for call in _calls(expression) if call.name in FUNCTIONS)
    return next((name for name in names if FUNCTIONS[name].kind is not Kind.ELEMENTARY), "")


def _couplers(model: Model) -> Iterator[Fault]:
    """Yield couplers of joints that do not move in the way that counts."""
    for coupler in model.couplers.values():
        for id, direction in zip(coupler.joint_ids, coupler.motion_types, strict=False):
            joint = model.joints.get(id)
            if joint is None or direction not in _DIRECTIONS:
                continue
            if direction not in JOINTS[joint.type].moves:
                message = f'motion_types="{" ".join(coupler.motion_types)}": joint {id} is '
                message += f"{joint.type} and does not {_DIRECTIONS[direction]} its z-axis"
                if moves := JOINTS[joint.type].moves:
                    message += f"; it has {' or '.join(moves)}"
                yield _fault(coupler.source, f"Constraint_Coupler[{coupler.id}]", message)


def _frictions(model: Model) -> Iterator[Fault]:
    """Yield frictions of joints that have none, or twice, and levers that lack or do not belong."""
    first: dict[int, int] = {}
    for friction in model.joint_frictions.values():
        joint, source = model.joints.get(friction.joint_id), friction.source
        name = f"Force_JointFriction[{friction.id}]"
        if joint is None:
            continue
        of = f"joint {joint.id} is {joint.type}"
        if joint.type not in _LEVERS:
            message = f'joint_id="{joint.id}": {of}; must be one of {", ".join(_LEVERS)}'
            yield _fault(source, name, message)
            continue
        if joint.id in first:
            message = f"friction {first[joint.id]} is in joint {joint.id} already; must be one"
            yield _fault(source, name, message)
        first.setdefault(joint.id, friction.id)
        lever = _LEVERS[joint.type]
        for attribute in ("pin_radius", "ball_radius"):
            value = getattr(friction, attribute)
            if attribute == lever and value is None:
                message = f"{attribute}: missing; {of}, which needs it, a number > 0"
                yield _fault(source, name, message)
            elif attribute != lever and value is not None:
                belongs = " or ".join(type for type, has in _LEVERS.items() if has == attribute)
                message = f'{attribute}="{value:g}": {of}; belongs to {belongs}'
                yield _fault(source, name, message)
        if joint.type == "SPHERICAL" and friction.bending_reaction_arm > 0.0:
            given = f'bending_reaction_arm="{friction.bending_reaction_arm:g}"'
            message = f"{given}: {of}, which bears no torque"
            yield _fault(source, name, message)
        for attribute, type in (("friction_arm", "REVOLUTE"), ("reaction_arm", "TRANSLATIONAL")):
            value = getattr(friction, attribute)
            if value > 0.0 and joint.type != type:
                message = f'{attribute}="{value:g}": {of}; belongs to {type}'
                yield _fault(source, name, message)


def _limits(model: Model) -> Iterator[Fault]:
    """Yield limits of joints that do not move in the way that is limited."""
    for limit in model.joint_limits.values():
        joint = model.joints.get(limit.joint_id)
        if joint is not None and limit.direction not in JOINTS[joint.type].moves:
            message = f'motion_type="{limit.direction}": joint {joint.id} is '
            message += _allowed(joint.type, "limit")
            yield _fault(limit.source, f"Force_JointLimit[{limit.id}]", message)


def _put_in(expression: Expression) -> Iterator[tuple[str, int]]:
    """Yield what an expression puts in place: variables by VARVAL, and by DIF1 what z' is."""
    for call in _calls(expression):
        if call.name in _PUT_IN and isinstance(call.args[0], Number):
            yield call.name, int(call.args[0].value)


#: What functions look at that depends on no state, and on where bodies are at most.
_OF_TIME = (Kind.ELEMENTARY, Kind.TABLE, Kind.VARIABLE)
_OF_POSES = (*_OF_TIME, Kind.DISPLACEMENT)
_PUT_IN = {"VARVAL": "Reference_Variable", "DIF1": "Control_Diff"}


def _circles(model: Model) -> Iterator[Fault]:
    """Yield variables and slopes of states that depend on themselves."""
    elements: dict[tuple[str, int], Any] = {
        ("VARVAL", id): variable for id, variable in model.variables.items()
    }
    elements.update({("DIF1", id): state for id, state in model.differentials.items()})
    uses = {key: list(_put_in(element.expr)) for key, element in elements.items()}
    finished: set[tuple[str, int]] = set()
    for start in uses:
        path: list[tuple[str, int]] = []
        stack = [(start, iter(uses[start]))]
        while stack:
            key, rest = stack[-1]
            if not path or path[-1] != key:
                path.append(key)
            step = next((v for v in rest if v in uses and v not in finished), None)
            if step is None:
                finished.add(key)
                stack.pop()
                path.pop()
            elif step in path:
                yield _circle(elements[step].source, [*path[path.index(step) :], step])
                finished.update(path)
                break
            else:
                stack.append((step, iter(uses[step])))


def _circle(source: Source, ring: list[tuple[str, int]]) -> Fault:
    """Return what is said of a ring of elements that need each other."""
    function, id = ring[0]
    alike = all(name == function for name, _ in ring)
    shown = " -> ".join(str(id) if alike else f"{name}({id})" for name, id in ring)
    what = "variable" if function == "VARVAL" else "slope"
    message = f"{function} leads back to the {what} itself: {shown}"
    return _fault(source, f"{_PUT_IN[function]}[{id}]", message)


def _tables(model: Model) -> Iterator[Fault]:
    """Yield expressions that ask more of splines and arrays than these have."""
    for source, name, attribute, expression in expressions(model):
        for call in _calls(expression):
            ids = [int(arg.value) if isinstance(arg, Number) else 0 for arg in call.args]
            said = f'{attribute}="{_short(expression.text)}": '
            spline = model.splines.get(ids[2]) if call.name in SPLINE_POINTS else None
            if spline is not None and len(spline.x) < SPLINE_POINTS[call.name]:
                said += f"{call.name} needs {SPLINE_POINTS[call.name]} points or more; spline "
                yield _fault(source, name, said + f"{spline.id} has {len(spline.x)}")
            array = model.arrays.get(ids[0]) if call.name == "ARYVAL" else None
            if array is not None and ids[1] > len(array.values):
                said += f"array {array.id} has {len(array.values)} numbers, no number {ids[1]}"
                yield _fault(source, name, said)


def _short(text: str) -> str:
    """Return a text short enough for one line of a message."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."

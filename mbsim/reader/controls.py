"""Control_Diff and Sensor_Event: states of the user's own, and what acts when something happens."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mbsim.errors import Fault
from mbsim.model import elements as el
from mbsim.reader.draft import Draft
from mbsim.reader.kinds import (
    EXPRESSION,
    FLAG,
    ID,
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    Kind,
    keyword,
)
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import GIVEN_BY, USERSUB, expression_or_user

_CROSSING = Kind(
    "TRUE, FALSE or a tolerance >= 0 of the crossing",
    lambda text: NOT_NEGATIVE.parse(text) > 0.0 if text[:1].isdigit() else FLAG.parse(text),
)
_IMPLICIT = "an implicit equation 0 = f(z, z') is not built; solve it for z' and leave it out"
_NO_SLOPE = "z' at the start is what expr gives; only an implicit equation has it given"


def _build_differential(entry: Entry) -> None:
    """Add a state."""
    expr, user = expression_or_user(entry, "DIFF", "DIFSUB")
    if expr is None:
        return
    differential = el.Differential(
        id=entry.get("id", 0),
        expr=expr,
        user=user,
        ic=entry.get("ic", 0.0),
        scale=entry.get("scale", 1.0),
        is_static_hold=entry.get("is_static_hold", False),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("differentials", differential)


CONTROL_DIFF = Statement(
    "Control_Diff",
    {
        **NAMED,
        "type": GIVEN_BY,
        "expr": Spec(EXPRESSION, "z', the rate of the state"),
        "ic": Spec(REAL, "z at the start", "", "0"),
        "ic_dot": Spec(REAL, note=_NO_SLOPE),
        "is_implicit": Spec(FLAG, refused=_IMPLICIT, harmless="FALSE"),
        "is_static_hold": Spec(FLAG, "TRUE: a static analysis leaves z as it is", "", "FALSE"),
        "scale": Spec(POSITIVE, "size of z by which its error is judged", "", "1"),  # ours
        **USERSUB,
    },
    _build_differential,
    about="a state of your own, by its differential equation",
)


_COMPARE = {name.lower(): name for name in ("GE", "LE", "GT", "LT", "EQ")}


def add_sensor(entry: Entry, sensor: el.Sensor) -> None:
    """Add a sensor; one that does nothing is worth a word."""
    acts = (sensor.evaluate, sensor.evaluate_id, sensor.dt, sensor.stepsize, sensor.h_max)
    flags = (sensor.halt, sensor.stops, sensor.prints)
    if all(action is None for action in acts) and not any(flags):
        entry.warn("has no action: it only notes when it becomes true")
    if sensor.compare == "EQ" and not sensor.zero_crossing and sensor.error_tol == 0.0:
        entry.warn("compare EQ without error_tol and zero_crossing: only a change of sign is seen")
    entry.register("sensors", sensor)


def _build_sensor(entry: Entry) -> None:
    """Add a sensor."""
    expr, user = expression_or_user(entry, "SENSOR", "SENSUB")
    if expr is None or (entry.given("compare") and entry.get("compare") is None):
        return
    sensor = el.Sensor(
        id=entry.get("id", 0),
        expr=expr,
        user=user,
        compare=entry.get("compare", "EQ"),
        value=entry.get("value", 0.0),
        error_tol=entry.get("error_tol", 0.0),
        zero_crossing=entry.get("zero_crossing", False),
        evaluate=entry.get("evaluate"),
        evaluate_id=entry.get("evaluate_id"),
        halt=entry.get("halt", False),
        stops=entry.get("return", False),
        prints=entry.get("print", False),
        dt=entry.get("dt"),
        stepsize=entry.get("stepsize"),
        h_max=entry.get("hmax"),
        verbose=entry.get("verbose", False),
        label=entry.get("label", ""),
        source=entry.source,
    )
    add_sensor(entry, sensor)


def _build_evaluation(entry: Entry) -> None:
    """Add what a sensor evaluates."""
    expr, user = expression_or_user(entry, "SENVAL", "SEVSUB")
    if expr is not None:
        label = entry.get("label", "")
        evaluation = el.Evaluation(entry.get("id", 0), expr, user, label, entry.source)
        entry.register("evaluations", evaluation)


def complete_sensors(draft: Draft) -> Iterator[Fault]:
    """Give sensors the expressions of what they evaluate; yield what does not fit."""
    first: dict[int, int] = {}
    for sensor in draft.sensors.values():
        source, id, said = sensor.source, sensor.evaluate_id, ""
        if id is None and sensor.evaluate is not None and draft.evaluations:
            said = "evaluate: SENVAL names the Sensor_Evaluate of this deck; give evaluate_id"
        elif id is not None and sensor.evaluate is not None:
            said = f'evaluate_id="{id}": gives what evaluate gives too; must be one of both'
        elif id is not None and id in first:
            said = f'evaluate_id="{id}": Sensor_Event {first[id]} sets it already; '
            said += "one value for several sensors is not built"
        elif id is not None and id in draft.evaluations:
            first[id] = sensor.id
            expr = draft.evaluations[id].expr
            draft.sensors[sensor.id] = replace(sensor, evaluate=expr)
        if said:
            yield Fault(source.file, source.line, f"Sensor_Event[{sensor.id}]", said)


SENSOR_EVENT = Statement(
    "Sensor_Event",
    {
        **NAMED,
        "type": GIVEN_BY,
        "expr": Spec(EXPRESSION, "what is watched"),
        "compare": Spec(keyword(_COMPARE), "how expr is held against value", "", "EQ"),
        "value": Spec(REAL, "what it is held against", "", "0"),
        "error_tol": Spec(NOT_NEGATIVE, "so far from value counts as there", "", "0"),
        "zero_crossing": Spec(_CROSSING, "whether a step ends at the crossing", "", "FALSE"),
        "evaluate": Spec(EXPRESSION, "what SENVAL(id) shows from then on"),  # ours; Adams'
        "evaluate_id": Spec(ID, "the Sensor_Evaluate that SENVAL shows from then on"),
        "halt": Spec(FLAG, "end the run", "", "FALSE"),
        "return": Spec(FLAG, "end this Simulate, the next begins", "", "FALSE"),
        "print": Spec(FLAG, "write a row at that time", "", "FALSE"),
        "dt": Spec(POSITIVE, "print interval until this Simulate ends", "T"),
        "stepsize": Spec(POSITIVE, "length of the next step", "T"),
        "hmax": Spec(POSITIVE, "longest step until this Simulate ends", "T"),
        "verbose": Spec(FLAG, "say so on the terminal; the log always does", "", "FALSE"),
        **USERSUB,
    },
    _build_sensor,
    about="acts when a condition becomes true",
)
SENSOR_EVALUATE = Statement(
    "Sensor_Evaluate",
    {
        **NAMED,
        "type": GIVEN_BY,
        "expr": Spec(EXPRESSION, "what is kept when its sensor acts"),
        **USERSUB,
    },
    _build_evaluation,
    about="what SENVAL shows from when a sensor acts",
)

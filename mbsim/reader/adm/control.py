"""Variables, data, sensors, requests and integrator of an Adams deck."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.adm.draft import require
from mbsim.reader.adm.subroutine import function_or_user, routine
from mbsim.reader.adm.translate import read_as
from mbsim.reader.command import PARAM_STATIC
from mbsim.reader.controls import add_sensor
from mbsim.reader.kinds import ID
from mbsim.reader.requests import user_results
from mbsim.reader.statement import Entry
from mbsim.reader.tables import add_array, add_spline

METHODS = ("GSTIFF", "WSTIFF", "HASTIFF", "HHT", "NEWMARK", "CONSTANT_BDF", "ABAM", "RKF45")
FORMULATIONS = ("I3", "SI2", "SI1", "SI0")
OF_METHODS = ("KMAX", "MAXIT", "CORRECTOR", "PATTERN", "FORMULATION", "INTERPOLATE", "ADAPTIVITY")


def build_variable(entry: Entry) -> None:
    """Add a variable."""
    expr, user = function_or_user(entry, "VARIABLE", "VARSUB")
    if expr is not None:
        variable = el.Variable(entry.get("id", 0), expr, user=user, source=entry.source)
        entry.register("variables", variable)


def build_differential(entry: Entry) -> None:
    """Add a state."""
    expr, user = function_or_user(entry, "DIFF", "DIFSUB")
    if expr is not None:
        state = el.Differential(
            entry.get("id", 0),
            expr,
            entry.get("IC", 0.0),
            is_static_hold=entry.get("STATIC_HOLD", False),
            user=user,
            source=entry.source,
        )
        entry.register("differentials", state)


def build_spline(entry: Entry) -> None:
    """Add a spline; of a surface each Y is a value of z and the curve there."""
    x, rows = entry.get("X"), entry.get("Y")
    if x is None or rows is None:
        return
    z: tuple[float, ...] = ()
    if len(rows) > 1 or len(rows[0]) == len(x) + 1:
        z, rows = tuple(row[0] for row in rows), tuple(row[1:] for row in rows)
    add_spline(entry, x, rows, z, "X", "Y")


def build_array(entry: Entry) -> None:
    """Add an array."""
    type = entry.get("KIND") or ("IC" if entry.given("NUMBERS") else "U")
    for name in ("KIND", "NUMBERS", "VARIABLES", "SIZE"):
        if entry.given(name) and entry.get(name) is None:
            return
    numbers, ids = entry.get("NUMBERS", ()), entry.get("VARIABLES", ())
    add_array(entry, type, entry.get("SIZE"), numbers, ids, ("SIZE", "NUMBERS", "VARIABLES"))


def build_sensor(entry: Entry) -> None:
    """Add a sensor."""
    expr, user = function_or_user(entry, "SENSOR", "SENSUB")
    if expr is None:
        return
    sensor = el.Sensor(
        entry.get("id", 0),
        expr,
        user=user,
        compare=entry.get("COMPARE", "EQ"),
        value=entry.get("VALUE", 0.0),
        error_tol=entry.get("ERROR", 1e-3),
        zero_crossing=entry.get("BISECTION", False),
        evaluate=entry.get("EVALUATE"),
        halt=entry.get("HALT", False),
        stops=entry.get("RETURN", False),
        prints=entry.get("PRINT", False),
        dt=entry.get("DT"),
        stepsize=entry.get("STEPSIZE"),
        source=entry.source,
    )
    add_sensor(entry, sensor)


COMPARE = ("EQ", "GE", "LE")
SENSOR_FLAGS = ("HALT", "PRINT", "RETURN")
OF_RESTARTS = ("CODGEN", "YYDUMP", "RESTART")
FUNCTIONS = tuple(f"F{k}" for k in range(1, 9))


def build_request(entry: Entry) -> None:
    """Add a request, by markers or by functions."""
    word = entry.get("TYPE")
    user = routine(entry, "REQSUB")
    functions = [name for name in FUNCTIONS if entry.given(name)]
    by_markers = [name for name in ("I", "J", "RM") if entry.given(name)]
    if word is None and not functions and not entry.given("FUNCTION"):
        require(entry, "TYPE", ", functions F1 ... F8, or FUNCTION=USER(...)")
    if entry.given("FUNCTION") and (functions or word or by_markers):
        entry.fault("stands for all of a request; TYPE, markers or F1 ... F8 are given", "FUNCTION")
    if functions and (word or by_markers):
        other = ", ".join(([word] if word else []) + by_markers)
        entry.fault(f"give functions or markers, not both ({', '.join(functions)} and {other})")
    if word is not None and not entry.given("I"):
        entry.fault(f"I: missing; must be {ID.allowed}")
    exprs = tuple(entry.get(name) for name in FUNCTIONS) if functions else ()
    if user is not None:
        exprs = user_results(entry, user)
    request = el.Request(
        id=entry.get("id", 0),
        type="EXPRESSION" if functions or user else f"MARKER_{word}",
        label=entry.get("TITLE", ""),
        comment=entry.get("COMMENT", ""),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J"),
        ref_marker_id=entry.get("RM"),
        exprs=exprs,
        user=user,
        source=entry.source,
    )
    entry.register("requests", request)


def build_integrator(entry: Entry) -> None:
    """Set tolerance and steps; the method is mbsim's own."""
    draft = entry.draft
    if draft.transient is not None:
        entry.fault(f"a second INTEGRATOR; the first is on line {draft.transient.source.line}")
        return
    h_min, h_max = entry.get("HMIN"), entry.get("HMAX")
    if h_min is not None and h_max is not None and h_min > h_max:
        entry.fault(f"must not be larger than HMAX ({h_max:g})", "HMIN")
    draft.transient = el.Transient(
        # Adams' own default, 1e-3, stands for the default of Adams decks
        integr_tol=None if entry.get("ERROR") is None else 1e-5 * entry.get("ERROR"),
        h_max=h_max,
        h_min=h_min,
        h0_max=entry.get("HINIT"),
        source=entry.source,
    )


def build_equilibrium(entry: Entry) -> None:
    """Set how equilibria are found."""
    read_as(entry, PARAM_STATIC, {"MAXIT": "max_num_iter", "IMBALANCE": "max_imbalance"})

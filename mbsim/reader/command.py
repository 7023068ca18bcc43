"""Simulate, Param_Transient, Force_Gravity and Stop: what runs, with what, in which order."""

from __future__ import annotations

from dataclasses import fields, replace

from mbsim.expressions import Expression
from mbsim.model import elements as el
from mbsim.reader.activity import check_joints
from mbsim.reader.keywords import ANALYSIS_NOT_BUILT, ANALYSIS_TYPES, spellings
from mbsim.reader.kinds import (
    COUNT,
    FLAG,
    ID,
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    REAL_OR_EXPRESSION,
    TEXT,
    keyword,
)
from mbsim.reader.linear_analysis import resolved
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

_MAX_ROWS = 1e8  # more output rows than this is a slip of the pen, and no disk holds them
_MAX_STATICS = 10_000  # equilibria of one Simulate, each an analysis of its own
_OUTPUTS = ("num_steps", "print_interval")


def _build_gravity(entry: Entry) -> None:
    """Set the model's gravity, or in <Command> the one from the next Simulate on."""
    draft = entry.draft
    in_command = entry.draft.in_command
    # in <Command> the statement modifies: a component not given keeps its value
    before = (draft.command_gravity or draft.gravity) if in_command else None
    start = before.g if before else (0.0, 0.0, 0.0)
    old = before.exprs if before else (None, None, None)
    g, exprs = list(start), list(old)
    for k, axis in enumerate("xyz"):
        given = entry.get(f"grav_{axis}")
        if isinstance(given, Expression):
            g[k], exprs[k] = 0.0, given
        elif given is not None:
            g[k], exprs[k] = given, None
    gravity = el.Gravity((g[0], g[1], g[2]), entry.source, tuple(exprs), entry.get("id") or 1)
    if in_command:
        draft.command_gravity = gravity
    elif draft.gravity is not None:
        entry.fault(f"a second Force_Gravity; the first is on line {draft.gravity.source.line}")
    else:
        draft.gravity = gravity


def _build_transient(entry: Entry) -> None:
    """Set the model's integration parameters, or those from the next Simulate on."""
    draft = entry.draft
    given = {
        field.name: entry.get(field.name)
        for field in fields(el.Transient)
        if field.name != "source" and entry.get(field.name) is not None
    }
    if "integrator_type" in given:
        given["integrator_type"] = given["integrator_type"].upper()
    transient = el.Transient(**given, source=entry.source)
    h_min, h_max, h0_max = transient.h_min, transient.h_max, transient.h0_max
    if h_min is not None and h_max is not None and h_min > h_max:
        entry.fault(f"must not be larger than h_max ({h_max:g})", "h_min")
    if h_min is not None and h0_max is not None and h_min > h0_max:
        # MotionSolve's own defaults are so: 1e-6 and 1e-8
        entry.note("is less than h_min: the first step is h_min at most", "h0_max")
    if not draft.in_command:
        if draft.transient is not None:
            line = draft.transient.source.line
            entry.fault(f"a second Param_Transient; the first is on line {line}")
        draft.transient = transient
    elif draft.command_transient is None:
        draft.command_transient = transient
    else:
        draft.command_transient = replace(draft.command_transient, **given, source=entry.source)


def _times(entry: Entry) -> tuple[float, float] | None:
    """Return start and end of a Simulate, None with a fault where they make no interval."""
    earlier = entry.draft.simulations
    start = earlier[-1].end_time if earlier else 0.0
    if entry.get("start_time") is not None:
        if earlier and entry.get("start_time") != start:
            entry.fault(
                f"a later Simulate starts where the one before ended, at {start:g}", "start_time"
            )
            return None
        start = entry.get("start_time")
    if entry.given("end_time") == entry.given("duration"):
        what = "give one, not both" if entry.given("duration") else "missing; one is needed"
        entry.fault(f"end_time or duration: {what}")
        return None
    end, duration = entry.get("end_time"), entry.get("duration")
    if end is None and duration is None:
        return None
    if end is None:
        end = start + duration
    if not end > start:
        entry.fault(f"must be larger than the start, {start:g}", "end_time")
        return None
    return start, end


def _build_timeless(entry: Entry) -> None:
    """Add an assembly, an equilibrium or a linear analysis, which take no time."""
    draft, kind = entry.draft, entry.get("analysis_type")
    unused = ("end_time", "duration", *_OUTPUTS, "print_increment")
    for name in ("start_time", *unused) if kind == "ASSEMBLY" else unused:
        if entry.given(name):
            entry.note(f"has no effect with analysis_type {kind}, which takes no time", name)
    now = draft.simulations[-1].end_time if draft.simulations else 0.0
    if kind != "ASSEMBLY" and entry.get("start_time") is not None:
        if draft.simulations and entry.get("start_time") != now:
            message = f"a later Simulate starts where the one before ended, at {now:g}"
            entry.fault(message, "start_time")
            return
        now = entry.get("start_time")
    draft.simulations.append(_at_once(entry, kind, now))


def _at_once(entry: Entry, kind: str, time: float, later: bool = False) -> el.Simulation:
    """Return an analysis of one time."""
    draft = entry.draft
    return el.Simulation(
        kind,
        time,
        time,
        1.0,
        draft.command_transient,
        draft.command_gravity,
        draft.static,
        draft.changes,
        tuple(sorted(draft.inactive)),
        resolved(entry) if kind == "LINEAR" else el.Linear(),
        later,
        entry.source,
    )


def _lasts(entry: Entry) -> bool:
    """Return whether an analysis of type Static is asked for over a span of time."""
    now = entry.draft.simulations[-1].end_time if entry.draft.simulations else 0.0
    start = entry.get("start_time", now)
    return entry.given("duration") or entry.get("end_time", start) != start


def _build_quasi_static(entry: Entry) -> None:
    """Add an equilibrium at each output time from the start to the end."""
    span = _span(entry)
    if span is None:
        return
    start, end, interval = span
    count = round((end - start) / interval)
    count += count * interval < (end - start) * (1.0 - 1e-9)
    if count > _MAX_STATICS:
        entry.fault(f"gives {count} equilibria from {start:g} to {end:g}; {_MAX_STATICS} at most")
        return
    times = [start + k * interval for k in range(count)] + [end]
    entry.draft.simulations += [
        _at_once(entry, "STATIC", time, later=k > 0) for k, time in enumerate(times)
    ]


def _build_static(entry: Entry) -> None:
    """Set how equilibria are found from here on."""
    names = {"max_num_iter": "max_num_iter", "max_imbalance": "imbalance"}
    given = {field: entry.get(name) for name, field in names.items() if entry.given(name)}
    entry.draft.static = replace(entry.draft.static, **given, source=entry.source)


def _build_simulate(entry: Entry) -> None:
    """Add one simulation."""
    draft = entry.draft
    check_joints(draft)
    if not entry.given("analysis_type"):
        entry.note("not given; taken as TRANSIENT", "analysis_type")
    kind = entry.get("analysis_type")
    if kind in ("ASSEMBLY", "LINEAR") or (kind == "STATIC" and not _lasts(entry)):
        _build_timeless(entry)
        return
    if kind == "STATIC":
        _build_quasi_static(entry)
        return
    span = _span(entry)
    if span is None:
        return
    start, end, interval = span
    simulation = el.Simulation(
        analysis_type=entry.get("analysis_type", "TRANSIENT"),
        start_time=start,
        end_time=end,
        print_interval=interval,
        transient=draft.command_transient,
        gravity=draft.command_gravity,
        changes=draft.changes,
        inactive=tuple(sorted(draft.inactive)),
        source=entry.source,
    )
    draft.simulations.append(simulation)


def _span(entry: Entry) -> tuple[float, float, float] | None:
    """Return start, end and time between output rows, None with a fault where they are none."""
    times = _times(entry)
    outputs = [name for name in _OUTPUTS if entry.given(name)]
    refused = [name for name in ("print_increment", "print_array_id") if entry.given(name)]
    if len(outputs) + len(refused) != 1:
        what = ", ".join(outputs + refused) or "none"
        entry.fault(f"exactly one of num_steps and print_interval is needed; {what} given")
        return None
    if times is None or refused or entry.get(outputs[0]) is None:
        return None
    start, end = times
    interval: float | None = entry.get("print_interval")
    if interval is None:
        interval = (end - start) / entry.get("num_steps")
    if not interval * _MAX_ROWS > end - start:
        rows = f"more than {_MAX_ROWS:.0e} output rows from {start:g} to {end:g}"
        entry.fault(f"gives {rows}", outputs[0])
        return None
    return start, end, interval


def _build_stop(entry: Entry) -> None:
    """Remember where the commands end."""
    entry.draft.stop_line = entry.node.line


_NO_EFFECT = "has no effect in mbsim's integrators"
_UNUSED = {
    "vel_tol_factor": POSITIVE,
    "rel_abs_tol_ratio": POSITIVE,
    "max_order": COUNT,
    "dae_alg_tol_factor": POSITIVE,
    "dae_index": COUNT,
    "dae_constr_tol": POSITIVE,
    "dae_corrector_maxit": POSITIVE,  # both are documented as real
    "dae_corrector_minit": NOT_NEGATIVE,
    "dae_vel_ctrl": FLAG,
    "dae_jacob_eval": NOT_NEGATIVE,
    "dae_eval_expiry": NOT_NEGATIVE,
    "dae_jacob_init": NOT_NEGATIVE,
    "dae_interpolation": FLAG,
    "newmark_beta": REAL,
    "newmark_gamma": REAL,
    "hht_alpha": REAL,
}
PARAM_TRANSIENT = Statement(
    "Param_Transient",
    {
        "integrator_type": Spec(TEXT, "method, or MotionSolve's name for one", "", "AUTO"),
        "integr_tol": Spec(POSITIVE, "100 times mbsim's dimensionless tol", "", "1e-3"),
        "h_max": Spec(POSITIVE, "longest step", "T", "none"),
        "h_min": Spec(POSITIVE, "shortest step; a shorter one ends the run", "T", "rounding"),
        "h0_max": Spec(POSITIVE, "longest first step", "T", "none"),
        "sleep": Spec(FLAG, "FALSE: MOREAU solves what is at rest too", "", "TRUE"),
        **{name: Spec(kind, note=_NO_EFFECT) for name, kind in _UNUSED.items()},
    },
    _build_transient,
    in_command=True,
    about="method, tolerance and step lengths",
)
_ITS_OWN = (
    "has no effect: mbsim's own search goes on until forces balance to rounding; "
    "max_imbalance and max_num_iter bound it"
)
_METHODS = keyword(spellings(MKEAM="", FIM_S="", FIM_D=""))
PARAM_STATIC = Statement(
    "Param_Static",
    {
        "max_num_iter": Spec(COUNT, "most iterations", "", "300", alias="maxit"),
        "max_imbalance": Spec(
            POSITIVE, "largest force left over", "F", "1e-10 of the weight", alias="imbalance"
        ),
        "method": Spec(_METHODS, note=_ITS_OWN),
        "max_error": Spec(POSITIVE, note=_ITS_OWN, alias="error"),
        "max_ke_tol": Spec(POSITIVE, note=_ITS_OWN, alias="kinetic_energy_error"),
        **{
            name: Spec(NOT_NEGATIVE, note=_ITS_OWN)
            for name in ("max_dq_tol", "stability", "compliance_delta")
        },
    },
    _build_static,
    in_command=True,
    about="how static equilibria are found",
)
FORCE_GRAVITY = Statement(
    "Force_Gravity",
    {
        "id": Spec(ID, "number by which others name it", "", "1"),
        "label": NAMED["label"],
        "full_label": NAMED["full_label"],
        **{
            f"grav_{axis}": Spec(REAL_OR_EXPRESSION, f"gravity along global {axis}", "L/T^2", "0")
            for axis in "xyz"
        },
    },
    _build_gravity,
    in_command=True,
    about="gravity",
)
_NOT_BUILT = "is documented but not built yet; use print_interval or num_steps"
SIMULATE = Statement(
    "Simulate",
    {
        "analysis_type": Spec(
            keyword(ANALYSIS_TYPES, ANALYSIS_NOT_BUILT), "what is done", "", "TRANSIENT"
        ),
        "label": Spec(TEXT, "is not shown"),
        "start_time": Spec(REAL, "time at which it starts", "T", "0, or the last end"),
        "end_time": Spec(REAL, "time at which it ends; this or duration", "T"),
        "duration": Spec(POSITIVE, "how long it lasts", "T"),
        "num_steps": Spec(COUNT, "output intervals; or print_interval", alias="num_step"),
        "print_interval": Spec(POSITIVE, "time between output rows", "T"),
        "print_increment": Spec(TEXT, refused=_NOT_BUILT),
        "print_array_id": Spec(TEXT, refused=_NOT_BUILT),
        "restart_array_id": Spec(TEXT, refused="is documented but not built yet"),
    },
    _build_simulate,
    in_model=False,
    in_command=True,
    about="one analysis: transient, kinematic, static, quasi-static, linear or assembly",
)
STOP = Statement(
    "Stop", {}, _build_stop, in_model=False, in_command=True, note="the deck ends here"
)

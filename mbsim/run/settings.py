"""How a model is run: the command line before the deck's Command before its Model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, SupportsFloat

import numpy as np

from mbsim.errors import ModelError
from mbsim.forces.catalog import (
    FORCES,
    Components,
    Expressed,
    Form,
    MultiPoint,
    OfResidual,
    Switched,
)
from mbsim.integrators.catalog import (
    AUTO,
    EXPLICIT,
    IMPLICIT,
    IMPLICIT_METHODS,
    METHODS,
    RIGID,
)
from mbsim.model.elements import ASIDE, Model, Simulation
from mbsim.model.forces import rigid_forces
from mbsim.model.names import element_name, is_adams

DEFAULT_TOL = 1e-5
#: Analyses of one time, which may be that at which a run ends.
_AT_ONCE = ("STATIC", "LINEAR")
TIGHTEST = 1e-15
#: Of an Adams deck, so that its curves agree with Adams' own to the digits that those carry.
DEFAULT_TOL_ADAMS = 1e-8
#: The loosest tol of a method with an estimate of its error. Within a looser one what lies on a
#: contact bounces for good, or slips, and takes more steps.
LOOSEST = 1e-2
#: Who says tol, where that is no deck.
BY_CALLER = "as the command line says"
#: What tol is of `integr_tol`: MotionSolve's default, 1e-3, is then the default.
PER_TOL = 100.0
INTEGRATORS = tuple(METHODS)
#: MotionSolve's names, and the method that runs them.
_MOTIONSOLVE_NAMES = {
    "ABAM": EXPLICIT,
    "VSTIFF": IMPLICIT,
    "MSTIFF": IMPLICIT,
    "DSTIFF": IMPLICIT,
}


@dataclass(frozen=True)
class Stage:
    """One Simulate with what holds for it; steps in [T]."""

    simulation: Simulation
    tol: float
    h_max: float
    h_min: float
    h0_max: float  # 0 if not given
    # who says tol, in words
    tol_from: str = field(default="", metadata={ASIDE: True})

    @property
    def is_static(self) -> bool:
        """Whether it is the search for an equilibrium."""
        return self.simulation.analysis_type == "STATIC"

    @property
    def is_linear(self) -> bool:
        """Whether it linearises the model where it stands."""
        return self.simulation.analysis_type == "LINEAR"

    @property
    def takes_time(self) -> bool:
        """Whether there is something to integrate."""
        return not (self.is_static or self.is_linear)


@dataclass(frozen=True)
class Settings:
    """How a model is run: the command line before the deck's Command before its Model."""

    stages: tuple[Stage, ...]
    integrator: str
    notes: tuple[str, ...] = field(metadata={ASIDE: True})

    @property
    def end_time(self) -> float:
        """End of the last simulation [T]."""
        return self.stages[-1].simulation.end_time

    @property
    def fixed(self) -> bool:
        """Whether steps are as long as the deck says: of MOREAU, where h_min is h_max."""
        return self.integrator == RIGID and any(s.h_min == s.h_max for s in self.stages)

    @property
    def tol(self) -> float:
        """Tolerance of the first simulation."""
        return self.stages[0].tol

    @property
    def tolerances(self) -> str:
        """What tol each simulation has and who says so, in words; once where all have the same."""
        said: list[str] = []
        for stage in self.stages:
            one = f"{stage.tol:g}, {stage.tol_from}"
            if not said:
                said.append(one)
            elif not said[-1].endswith(one):
                said.append(f"from time {stage.simulation.start_time:g} on {one}")
        return "; ".join(said)


def _checked(name: str, value: float, low: float, high: float) -> float:
    """Return a number given by the caller, or raise what is allowed."""
    most = "finite" if math.isinf(high) else f"at most {high:g}"
    if not isinstance(value, SupportsFloat):
        raise ModelError(f"{name}={value!r} is not allowed: a number above {low:g}, {most}")
    if not low < value <= high or math.isinf(value):
        raise ModelError(f"{name}={value:g} is not allowed: above {low:g}, {most}")
    return value


def _simulations(
    model: Model, end_time: float | None, print_interval: float | None
) -> tuple[Simulation, ...]:
    """Return what to run: the deck's Simulate statements, cut or replaced by the caller's times."""
    # every simulation begins with an assembly; one alone is a run of no time
    planned = [s for s in model.simulations if s.analysis_type != "ASSEMBLY"]
    if not planned and model.simulations:
        if end_time is not None or print_interval is not None:
            raise ModelError(
                f"{model.file}: the deck only assembles (analysis_type Assembly): "
                "--end-time and --print-interval do not apply"
            )
        return (model.simulations[-1],)
    if not planned and is_adams(model.file) and None in (end_time, print_interval):
        raise ModelError(
            f"{model.file}: an .adm deck says neither end time nor output interval; "
            "give --end-time and --print-interval"
        )
    if end_time is not None:
        _checked("end_time", end_time, 0.0, math.inf)
        if not planned:
            planned = [Simulation(end_time=end_time, print_interval=end_time / 100.0)]
        planned = [
            s
            for s in planned
            if s.start_time < end_time or (s.start_time <= end_time and s.analysis_type in _AT_ONCE)
        ]
        if not planned:
            raise ModelError(f"end_time={end_time:g} is before the deck's first start_time")
        kept = [replace(s, end_time=min(s.end_time, end_time)) for s in planned]
        if kept[-1].analysis_type not in _AT_ONCE:
            kept[-1] = replace(kept[-1], end_time=end_time)
        planned = kept
    if not planned:
        raise ModelError(f"{model.file}: the deck has no Simulate; give --end-time")
    if print_interval is not None:
        _checked("print_interval", print_interval, 0.0, math.inf)
        planned = [replace(s, print_interval=print_interval) for s in planned]
    return tuple(planned)


def _tolerance(model: Model, simulation: Simulation, tol: float | None) -> tuple[float, str]:
    """Return tol of one Simulate, checked, and who says it: the caller, the deck or nobody."""
    adams = is_adams(model.file)
    if tol is not None:
        return _checked("tol", tol, TIGHTEST, 0.1), BY_CALLER
    for source, part in ((simulation.transient, "<Command>"), (model.transient, "<Model>")):
        if source is None or source.integr_tol is None:
            continue
        where = f"{source.source.file or model.file}:{source.source.line}"
        if adams:
            # the reader has made it of ERROR
            name, said, chosen = "tol", f"1e-5 of INTEGRATOR/ERROR ({where})", source.integr_tol
        else:
            name, chosen = "integr_tol", source.integr_tol / PER_TOL
            said = f"{1.0 / PER_TOL:g} of integr_tol {source.integr_tol:g} in {part} ({where})"
        try:
            return _checked("tol", chosen, 1e-15, 0.1), said
        except ModelError as error:
            raise ModelError(f"{where}: Param_Transient: {name}: {error}; {said}") from None
    return DEFAULT_TOL_ADAMS if adams else DEFAULT_TOL, "the default"


def _no_looser(stage: Stage) -> Stage:
    """Return a stage whose tol is LOOSEST where a looser one was said."""
    if not stage.tol > LOOSEST:
        return stage
    return replace(stage, tol=LOOSEST, tol_from=f"for {stage.tol:g}, {stage.tol_from}")


def _asked_method(model: Model, sources: Any, integrator: str | None) -> tuple[str, str]:
    """Return the name of the method for one Simulate, and where it was said."""
    if integrator:
        if not isinstance(integrator, str):
            raise ModelError(f"integrator={integrator!r} is not allowed: the name of a method")
        return integrator.upper(), "integrator"
    for source in sources:
        if source is not None and source.integrator_type:
            where = f"{model.file}:{source.source.line}: Param_Transient: integrator_type"
            return source.integrator_type.upper(), where
    return INTEGRATORS[0], "integrator (default)"


def _method(asked: dict[str, str]) -> tuple[str, list[str]]:
    """Return the one method of all Simulates, and what is to be said about its name.

    `asked` has for every name that was given where it was said.
    """
    notes = []
    methods: dict[str, str] = {}
    for name, where in sorted(asked.items()):
        if name in _MOTIONSOLVE_NAMES:
            runs = _MOTIONSOLVE_NAMES[name]
            notes.append(f"integrator {name}: run by {runs} ({METHODS[runs]})")
        elif name not in INTEGRATORS:
            allowed = ", ".join((*INTEGRATORS, *_MOTIONSOLVE_NAMES))
            raise ModelError(f"{where}={name} is not known; there are {allowed}")
        methods.setdefault(_MOTIONSOLVE_NAMES.get(name, name), where)
    if len(methods) > 1:
        both = " and ".join(f"{where}={name}" for name, where in methods.items())
        raise ModelError(f"{both}: one method runs all Simulates")
    return next(iter(methods)), notes


def _refuse_verlet(model: Model) -> None:
    """Raise where VERLET cannot run a model: its step is found from stiffness on free bodies.

    It holds friction back to a part of what would stop the slip in a step, so that friction with
    memory is not what its law says, whatever the step.
    """
    from mbsim.laws.catalog import FRICTION_LAWS

    keeping = {name for name in FRICTION_LAWS if FRICTION_LAWS[name].memory > 0}
    unknown = "forces of known stiffness, which {} does not say"
    forgets = "friction without memory, for it holds friction back; {} remembers"
    held = "free bodies and this model has joints or other constraints"
    whys: dict[type[Form], str] = {
        Expressed: unknown.format("an expression"),
        Components: unknown.format("an expression"),
        OfResidual: unknown.format("a user's residual"),
        MultiPoint: unknown.format("a matrix of many markers"),
    }
    kinds = [FORCES[name] for name in FORCES]
    forces = [
        (kind.statement, model.table(kind.name), type(kind.form))
        for kind in kinds
        if getattr(kind.form, "bounds", None) is None
    ]
    refused: list[tuple[str, Mapping[int, Any], str]] = [
        *((name, table, held) for name, table, form in forces if form not in whys),
        ("Constraint_Joint", model.joints, held),
        ("Constraint_Jprim", model.primitives, held),
        ("Constraint_Coupler", model.couplers, held),
        ("Motion_Joint", model.motions, held),
        ("Constraint_General", model.general_constraints, held),
        ("Constraint_PTCV", model.points_on_curves, held),
        ("Constraint_CVCV", model.curves_on_curves, held),
        ("Constraint_PTSF", model.points_on_surfaces, held),
        *((name, table, whys[form]) for name, table, form in forces if form in whys),
        (
            "Control_Diff",
            model.differentials,
            "bodies alone, and this model has states of its own",
        ),
        *(
            (
                "Force_Contact",
                {id: contact},
                forgets.format(contact.cff_type),
            )
            for id, contact in model.contacts.items()
            if contact.cff_type in keeping and not contact.rigid
        ),
    ]
    for statement, elements, why in refused:
        for element in elements.values():
            xml = getattr(element, "statement", statement)
            name = element_name(model.file, xml, element.id)
            raise ModelError(
                f"{model.file}:{element.source.line}: {name}: integrator VERLET is for {why}; "
                "take DOPRI5 or DOP853"
            )


def _for_rigid_friction(model: Model, method: str) -> tuple[str, list[str]]:
    """Return the method that runs a model, and what is to be said, where friction is rigid.

    Raises
    ------
    ModelError
        For an explicit method: it has no unknown for the force that holds.
    """
    contact = next((c for c in model.contacts.values() if c.rigid), None)
    dry = next(iter(rigid_forces(model)), None)
    if (contact is None and dry is None) or method in (*IMPLICIT_METHODS, RIGID):
        return method, []
    if contact is not None:
        source, name = contact.source, element_name(model.file, "Force_Contact", contact.id)
        said, instead = "tangential_stiffness=INFINITE", "a stiffness"
    else:
        assert dry is not None
        kind, force = dry
        source, name = force.source, element_name(model.file, kind.statement, force.id)
        assert isinstance(kind.form, Switched)  # the only form that can be rigid
        instead = kind.form.rigid_by
        said = f"{instead}=0"
    if method == AUTO:
        return IMPLICIT, [f"integrator AUTO: {IMPLICIT} from the start, for {name} is rigid"]
    raise ModelError(
        f"{model.file}:{source.line}: {name}: {said}: rigid friction is for implicit methods "
        f"and integrator {method} is explicit; take {' or '.join(IMPLICIT_METHODS)}, or give "
        f"{instead}"
    )


def settle(
    model: Model,
    end_time: float | None = None,
    print_interval: float | None = None,
    integrator: str | None = None,
    tol: float | None = None,
) -> Settings:
    """Return the settings of a run.

    Raises
    ------
    ModelError
        If a value is out of range or there is nothing to simulate.
    """
    notes = []
    stages = []
    asked: dict[str, str] = {}
    awake = False
    motionsolve = model.compatibility.upper().replace("_", "") == "MOTIONSOLVE"
    for simulation in _simulations(model, end_time, print_interval):
        sources = (simulation.transient, model.transient)

        def said(attribute: str, sources: Any = sources) -> Any:
            values = (getattr(source, attribute) for source in sources if source is not None)
            return next((value for value in values if value is not None), None)

        method, where = _asked_method(model, sources, integrator)
        asked.setdefault(method, where)
        awake |= said("sleep") is False
        chosen, who = _tolerance(model, simulation, tol)
        h_max = said("h_max") or math.inf
        if motionsolve:
            h_max = min(h_max, simulation.print_interval)
        h_min, h0_max = said("h_min") or 0.0, said("h0_max") or 0.0
        # the first step is no shorter than the shortest; 0 is none given
        h0_max = max(h0_max, h_min) if h0_max else 0.0
        stages.append(Stage(simulation, chosen, h_max, h_min, h0_max, who))
    if motionsolve:
        notes.append(f"compatibility MOTIONSOLVE: h_max = {stages[0].h_max:g}")
    method, said_of_names = _method(asked)
    if method == "VERLET":
        _refuse_verlet(model)
    if method == RIGID:
        from mbsim.stepping.refusals import refuse

        refuse(model)
        if len({stage.h_min == stage.h_max for stage in stages}) > 1:
            raise ModelError(
                f"{model.file}: Param_Transient: integrator MOREAU takes steps of a fixed length "
                "where h_min is h_max: in all Simulates of a deck, or in none"
            )
    method, said_of_friction = _for_rigid_friction(model, method)
    notes += said_of_friction
    if awake and method != RIGID:
        notes.append(f"Param_Transient sleep: is for MOREAU; nothing sleeps with {method}")
    notes += _late_sensors(model, stages)
    if method not in (RIGID, "VERLET"):
        stages = [_no_looser(stage) for stage in stages]
    settings = Settings(tuple(stages), method, (*notes, *said_of_names))
    return replace(settings, notes=(*settings.notes, f"tol {settings.tolerances}"))


def _late_sensors(model: Model, stages: Sequence[Stage]) -> list[str]:
    """Return a note on the sensors that act at the end of a step, where steps may be long."""
    late = [sensor for sensor in model.sensors.values() if not sensor.zero_crossing]
    if not late or all(math.isfinite(stage.h_max) for stage in stages if stage.takes_time):
        return []
    name = element_name(model.file, "Sensor_Event", late[0].id)
    others = f" and {len(late) - 1} more" if len(late) > 1 else ""
    crossing = "BISECTION" if is_adams(model.file) else 'zero_crossing="TRUE"'
    return [
        f"{name}{others}: acts at the end of the step that finds it true, and steps may be long; "
        f"{crossing} ends a step there, h_max bounds them"
    ]


def tightened(settings: Settings, tighter: float, least_steps: float, h_most: float) -> Settings:
    """Return the settings with smaller tolerances and shorter steps.

    `least_steps` is how many steps the whole run takes at least, `h_most` their longest [T].
    """
    span = settings.end_time - settings.stages[0].simulation.start_time
    longest = min(h_most, span / least_steps if least_steps > 0.0 and span > 0.0 else math.inf)
    stages = tuple(
        replace(stage, tol=max(TIGHTEST, tighter * stage.tol), h_max=min(stage.h_max, longest))
        for stage in settings.stages
    )
    return replace(settings, stages=stages)


def output_rows(settings: Settings) -> float:
    """Return about how many output times all Simulates of a run have."""
    stages = [stage.simulation for stage in settings.stages]
    return sum((one.end_time - one.start_time) / one.print_interval + 1.0 for one in stages)


def output_times(simulation: Simulation, last: bool) -> np.ndarray[Any, Any]:
    """Return the output times of one Simulate; a restart's row belongs to the one that follows."""
    t0, t1, dt = simulation.start_time, simulation.end_time, simulation.print_interval
    # a whole number of intervals up to rounding ends exactly at the end
    count = math.floor((t1 - t0) / dt * (1.0 + 1e-12) + 1e-9)
    times = t0 + dt * np.arange(count + 1)
    times = times[times < t1 - 1e-9 * dt]
    return np.append(times, t1) if last else times

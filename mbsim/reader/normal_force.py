"""What Force_Contact needs for each cnf_type: checks that go beyond one attribute's value."""

from __future__ import annotations

from collections.abc import Callable

from mbsim.laws.catalog import NORMAL_LAWS
from mbsim.reader.statement import Entry

DEFAULT_SPEED = 1e-3  # of transition velocities, in model units whatever these are

_USER_LAW = {"cnf_param_string", "cnf_fnc_name", "cnf_dll_name", "cnf_language"}
_MODULI = ("i_elastic_modulus", "j_elastic_modulus")


def check_normal(entry: Entry, cnf_type: str) -> None:
    """Note the attributes that the law does not read, and check those it does."""
    every = {name for law in NORMAL_LAWS for name in NORMAL_LAWS[law].parameters}
    read = _USER_LAW if cnf_type == "USERCNF" else set(NORMAL_LAWS[cnf_type].parameters)
    note_unused(entry, f"cnf_type {cnf_type}", (every | _USER_LAW) - read)
    if cnf_type == "USERCNF":
        return
    if cnf_type in _CHECKS:
        _CHECKS[cnf_type](entry)


def note_unused(entry: Entry, law: str, names: set[str]) -> None:
    """Note the attributes of other laws, which the chosen law does not read."""
    for name in entry.statement.attributes:
        if name in names and entry.given(name):
            entry.note(f"has no effect with {law}", name)


def warn_default_speed(entry: Entry, name: str) -> None:
    """Warn of a transition velocity left at 1e-3 where that is not 1e-3 m/s."""
    units = entry.draft.units
    if not entry.given(name) and units and units.length_m != units.time_s:
        entry.warn(
            f"{name}: not given; the default 1e-3 is in model units "
            f"({units.length}/{units.time}), here {1e-3 * units.length_m / units.time_s:g} m/s"
        )


def _check_impact(entry: Entry) -> None:
    """Check what IMPACT needs: a depth of full damping wherever there is damping."""
    if entry.get("damping", 0.0) > 0.0 and not entry.given("dmax"):
        entry.fault(
            "dmax: missing; IMPACT with damping > 0 needs dmax > 0, the depth of full damping"
        )
    _check_spring(entry)


def _check_spring(entry: Entry) -> None:
    """Warn of a spring without stiffness, and of one that is infinitely stiff at touch."""
    if entry.get("stiffness", 0.0) == 0.0 and (
        not entry.given("stiffness") or entry.get("stiffness") is not None
    ):
        entry.warn("stiffness is 0: the contact has no spring and holds nothing apart")
    if entry.get("exponent", 1.5) < 1.0:
        entry.warn("below 1 the stiffness is infinite at touch", "exponent")


def _check_hunt_crossley(entry: Entry) -> None:
    """Check the spring of HUNT_CROSSLEY, and that its damping is given in one way."""
    _check_spring(entry)
    _check_restitution(entry, "HUNT_CROSSLEY")


def _check_restitution(entry: Entry, law: str) -> None:
    """Check that damping is given at most once: as a [T/L], or by the rebound at a speed."""
    if not entry.given("restitution_coef"):
        if entry.given("ref_velocity"):
            entry.note(f"has no effect with {law} without restitution_coef", "ref_velocity")
        return
    if entry.given("damping"):
        entry.fault(f"{law} takes damping or restitution_coef, not both", "restitution_coef")
    if entry.get("restitution_coef") == 0.0:
        entry.fault(
            f"must be > 0 and <= 1 with {law}: no finite damping stops a body dead",
            "restitution_coef",
        )
    if not entry.given("ref_velocity"):
        entry.fault(
            f"ref_velocity: missing; must be a number > 0: with {law} the rebound depends on the "
            "speed, and restitution_coef holds at this one"
        )


def _check_hertz(entry: Entry) -> None:
    """Check that HERTZ has its stiffness from one source, and all of it."""
    _check_restitution(entry, "HERTZ")
    moduli = [name for name in _MODULI if entry.given(name)]
    if entry.given("stiffness"):
        if moduli:
            entry.fault("HERTZ takes stiffness or elastic moduli, not both", "stiffness")
        _check_spring(entry)
        for name in ("i_poisson_ratio", "j_poisson_ratio", "i_radius", "j_radius"):
            if entry.given(name) and not moduli:
                entry.note("has no effect with HERTZ where stiffness is given", name)
    elif not moduli:
        entry.fault(
            "stiffness: missing; HERTZ needs stiffness >= 0, or i_elastic_modulus and "
            "j_elastic_modulus > 0 (of one side only: the other is rigid)"
        )
    else:
        for side in "ij":
            _check_material(entry, side, "HERTZ")


def _check_material(entry: Entry, side: str, law: str) -> None:
    """Check the material of one side: modulus and Poisson's ratio, or neither (rigid)."""
    modulus, ratio = f"{side}_elastic_modulus", f"{side}_poisson_ratio"
    if not entry.given(modulus):
        entry.note("not given: this side is rigid", modulus)
        if entry.given(ratio):
            entry.note(f"has no effect without {modulus}", ratio)
        return
    if entry.get(modulus) == 0.0:
        entry.fault(f"must be a number > 0 with {law}", modulus)
    if not entry.given(ratio) and law == "VOLUME":
        # as MotionSolve has it: one modulus, of the layer between what holds its sides
        entry.note(f"not given; taken as 0: {modulus} is the stiffness of the layer", ratio)
    elif not entry.given(ratio):
        entry.fault(f"{ratio}: missing; {law} needs it beside {modulus}, > -1 and <= 0.5")


def _check_volume(entry: Entry) -> None:
    """Check the layers of VOLUME: modulus, Poisson's ratio and depth of one side or both."""
    if entry.get("contact_depth", "FIELD") == "LARGEST":
        entry.fault("VOLUME presses by the field of depth: FIELD, or nothing", "contact_depth")
    if not any(entry.given(name) for name in _MODULI):
        entry.fault(
            "i_elastic_modulus: missing; VOLUME needs i_elastic_modulus or j_elastic_modulus > 0 "
            "(of one side only: the other is rigid)"
        )
        return
    for side in "ij":
        _check_material(entry, side, "VOLUME")
        modulus, layer = f"{side}_elastic_modulus", f"{side}_layer_depth"
        if not entry.given(modulus):
            if entry.given(layer):
                entry.note(f"has no effect without {modulus}", layer)
            continue
        if not entry.given(layer):
            entry.fault(f"{layer}: missing; VOLUME needs the depth of the layer beside {modulus}")
        if entry.get(f"{side}_poisson_ratio", 0.0) == 0.5:
            message = "must be < 0.5 with VOLUME: a layer that cannot widen would not yield"
            entry.fault(message, f"{side}_poisson_ratio")
    _check_exponent(entry)


def _check_exponent(entry: Entry) -> None:
    if entry.get("exponent", 1.0) < 1.0:
        entry.warn("below 1 the stiffness is infinite at touch", "exponent")


def _check_poisson(entry: Entry) -> None:
    """Warn of what POISSON is left to assume, or cannot do."""
    if not entry.given("penalty"):
        entry.warn("penalty: not given; the documented default 0.1 holds hardly anything apart")
    elif entry.get("penalty") == 0.0:
        entry.warn("is 0: the contact has no spring and holds nothing apart", "penalty")
    warn_default_speed(entry, "normal_trans_vel")


_CHECKS: dict[str, Callable[[Entry], None]] = {
    "IMPACT": _check_impact,
    "HUNT_CROSSLEY": _check_hunt_crossley,
    "HERTZ": _check_hertz,
    "POISSON": _check_poisson,
    "VOLUME": _check_volume,
}

"""Control_PlantInput, Control_PlantOutput and Param_Linear: what a linear analysis is made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from mbsim.errors import Fault
from mbsim.model import elements as el
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import COUNT, FLAG, ID, NOT_NEGATIVE, REAL, TEXT, keyword
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.tables import VARIABLES

_PINPUT, _POUTPUT = "Control_PlantInput", "Control_PlantOutput"
_BY_USER = "by a subroutine is not built; list variables"
_COSIMULATION = "is for co-simulation, which mbsim has by mbsim.open"


def _plant(name: str, about: str) -> Statement:
    """Return the statement that lists inputs or outputs."""

    def build(entry: Entry) -> None:
        ids, count = entry.get("variable_id_list"), entry.get("num_element")
        if ids is None:
            return
        if count is not None and count != len(ids):
            entry.fault(f"is {count}, and {len(ids)} variables are listed", "num_element")
            return
        plant = el.Plant(entry.get("id", 0), ids, entry.get("label", ""), entry.source)
        entry.register_in(entry.draft.plants.setdefault(name, {}), plant)

    return Statement(
        name,
        {
            **NAMED,
            "num_element": Spec(COUNT, "number of variables", alias="num_variable"),
            "variable_id_list": Spec(
                VARIABLES, "Reference_Variables, in this order", required=True
            ),
            "type": Spec(TEXT, refused=_BY_USER, harmless="expression"),
            **{
                f"usrsub_{what}": Spec(TEXT, refused=_BY_USER)
                for what in ("dll_name", "fnc_name", "param_string")
            },
            **{
                each: Spec(NOT_NEGATIVE, note=_COSIMULATION)
                for each in ("hold_order", "sampling_period", "offset_time")
            },
            "is_active": Spec(FLAG, refused="is not built", harmless="true"),
        },
        build,
        about=about,
    )


CONTROL_PLANT_INPUT = _plant(_PINPUT, "inputs of linearised models: variables")
CONTROL_PLANT_OUTPUT = _plant(_POUTPUT, "outputs of linearised models: variables")


def check_plants(draft: Draft) -> Iterator[Fault]:
    """Yield plants that name variables which are not there."""
    for name, plants in draft.plants.items():
        for plant in plants.values():
            for id in plant.variable_ids:
                if id not in draft.variables and ("Reference_Variable", id) not in draft.broken:
                    said = f"variable_id_list: there is no Reference_Variable {id}"
                    file = plant.source.file or draft.file
                    yield Fault(file, plant.source.line, f"{name}[{plant.id}]", said)


def _build_linear(entry: Entry) -> None:
    """Set what linear analyses give from here on."""
    given = {
        field: entry.get(field)
        for field in ("pinput_id", "poutput_id", "eigen_analysis")
        if entry.get(field) is not None
    }
    entry.draft.linear = replace(entry.draft.linear, **given, source=entry.source)


def resolved(entry: Entry) -> el.Linear:
    """Return what a linear analysis gives, with the variables of its inputs and outputs."""
    draft = entry.draft
    linear, found = draft.linear, dict[str, Any]()
    for name, id, field in (
        (_PINPUT, linear.pinput_id, "inputs"),
        (_POUTPUT, linear.poutput_id, "outputs"),
    ):
        if id is None:
            continue
        plant = draft.plants.get(name, {}).get(id)
        if plant is None:
            if (name, id) not in draft.broken:
                line = linear.source.line or entry.node.line
                draft.fault(line, "Param_Linear", f"there is no {name} {id}")
            continue
        found[field] = plant.variable_ids
    return replace(linear, **found)


_FILES = "A, B, C, D, eigenvalues and shapes are in /linear of the result file, whatever it says"
_OWN = "has no effect: LAPACK balances A by itself"
_ENERGIES = "energies of modes are not written"
_MODES = {
    f"{energy}_modes_{what}clude": Spec(TEXT, note=_ENERGIES)
    for energy in ("ke", "se", "de")
    for what in ("ex", "in")
}
PARAM_LINEAR = Statement(
    "Param_Linear",
    {
        "pinput_id": Spec(ID, "Control_PlantInput whose variables are the inputs u", "", "none"),
        "poutput_id": Spec(ID, "Control_PlantOutput whose variables are the outputs", "", "none"),
        "pstate_id": Spec(TEXT, refused="other states than positions and turns are not built"),
        "eigen_analysis": Spec(FLAG, "FALSE: matrices only are told", "", "TRUE"),
        "disable_damping": Spec(
            FLAG, refused="is not built; take the damping out of the forces", harmless="false"
        ),
        "gyroscopic": Spec(
            keyword(spellings(FULL="", PARTIAL="", NONE="")),
            note="has no effect: all terms of velocities are in A",
            harmless="full",
        ),
        "anim_scale": Spec(REAL, note="has no effect: mbsim view has its own size of a mode"),
        "balancing": Spec(keyword(spellings(TRUE="", FALSE="", AUTO="")), note=_OWN),
        **{
            name: Spec(keyword(spellings(TRUE="YES", FALSE="NO")), note=_FILES)
            for name in ("write_simulinkmdl", "write_matlabfiles", "write_oml", "write_eig_info")
        },
        **{
            name: Spec(keyword(spellings(TRUE="YES", FALSE="NO")), note=_ENERGIES)
            for name in ("write_energy_dist", "write_energy_html")
        },
        **_MODES,
    },
    _build_linear,
    in_command=True,
    about="inputs and outputs of linear analyses",
)

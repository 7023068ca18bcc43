"""MATRIX, LSE, GSE and TFSISO of an Adams deck: linear control systems."""

from __future__ import annotations

from mbsim.reader.adm.declare import ANY, LIST, NUMBERS, ROUTINE, AdmStatement
from mbsim.reader.adm.subroutine import as_attributes, routine
from mbsim.reader.adm.translate import read_as, written
from mbsim.reader.control_siso import CONTROL_SISO
from mbsim.reader.control_state_eqn import CONTROL_STATE_EQN
from mbsim.reader.kinds import COUNT, FLAG, ID, USER, Kind, keyword
from mbsim.reader.linear_analysis import CONTROL_PLANT_INPUT, CONTROL_PLANT_OUTPUT
from mbsim.reader.matrix import REFERENCE_MATRIX
from mbsim.reader.statement import Entry, Spec, Statement
from mbsim.reader.tables import VARIABLES as BY_BLANKS

_NOT_BUILT = "is documented but not built yet; give VALUES"
_ID = {"id": Spec(ID, required=True)}
_HOLD = {"STATIC_HOLD": ("STATIC_HOLD", "TRUE")}

VARIABLES = Kind(f"ids of variables {LIST}", BY_BLANKS.parse)


def build_matrix(entry: Entry) -> None:
    """Add a matrix, dense or sparse."""
    if entry.get("SPARSE", False):
        rows, columns, values = (entry.get(name) for name in ("I", "J", "VALUES"))
        if rows is None or columns is None or values is None:
            entry.fault("SPARSE needs I, J and VALUES")
            return
        if not len(rows) == len(columns) == len(values):
            counts = f"{len(rows)} I, {len(columns)} J and {len(values)} VALUES"
            entry.fault(f"{counts}: must be as many of each")
            return
        triples = tuple(x for each in zip(rows, columns, values, strict=True) for x in each)
        fixed = {"issparse": "TRUE", "values": written(triples)}
        read_as(entry, REFERENCE_MATRIX, {"ROWS": "nrow", "COLUMNS": "ncol"}, fixed)
        return
    for name in ("I", "J"):
        if entry.given(name):
            entry.fault("is of a SPARSE matrix", name)
            return
    names = {"ROWS": "nrow", "COLUMNS": "ncol", "VALUES": "values"}
    by_row = "TRUE" if entry.get("FULL") == "RORDER" else "FALSE"
    read_as(entry, REFERENCE_MATRIX, names, {"isroworder": by_row})


MATRIX = AdmStatement(
    "MATRIX",
    {
        **_ID,
        "FULL": Spec(keyword({"rorder": "RORDER", "corder": "CORDER"})),
        "SPARSE": Spec(FLAG),
        "ROWS": Spec(COUNT, required=True),
        "COLUMNS": Spec(COUNT, required=True),
        "I": Spec(NUMBERS),
        "J": Spec(NUMBERS),
        "VALUES": Spec(NUMBERS),
        "FILE": Spec(ANY, refused=_NOT_BUILT),
        "NAME": Spec(ANY, refused=_NOT_BUILT),
    },
    build_matrix,
    words={"SPARSE": ("SPARSE", "TRUE")},
    xml="Reference_Matrix",
)
_ARRAYS = {"X": "x_array_id", "U": "u_array_id", "Y": "y_array_id"}
_MATRICES = {name: f"{name.lower()}_matrix_id" for name in "ABCD"}


def build_linear(entry: Entry) -> None:
    """Add a system by its matrices."""
    names = _ARRAYS | _MATRICES | {"IC": "ic_array_id", "STATIC_HOLD": "is_static_hold"}
    read_as(entry, CONTROL_STATE_EQN, names)


def _plant(name: str, statement: Statement) -> AdmStatement:
    """Return the statement that lists inputs or outputs of linear analyses."""

    def build(entry: Entry) -> None:
        read_as(entry, statement, {"VARIABLES": "variable_id_list"})

    return AdmStatement(
        name, {**_ID, "VARIABLES": Spec(VARIABLES, required=True)}, build, xml=statement.name
    )


PINPUT = _plant("PINPUT", CONTROL_PLANT_INPUT)
POUTPUT = _plant("POUTPUT", CONTROL_PLANT_OUTPUT)
LSE = AdmStatement(
    "LSE",
    {
        **_ID,
        "X": Spec(ID, required=True),
        "U": Spec(ID),
        "Y": Spec(ID),
        "IC": Spec(ID),
        "A": Spec(ID, required=True),
        **{name: Spec(ID) for name in "BCD"},
        "STATIC_HOLD": Spec(FLAG),
    },
    build_linear,
    words=_HOLD,
    xml="Control_StateEqn",
)


def build_general(entry: Entry) -> None:
    """Add a system by a subroutine, read as the XML's."""
    user = routine(entry, "GSESUB")
    if user is None:
        return
    names = _ARRAYS | {"IC": "ic_array_id", "STATIC_HOLD": "is_static_hold"}
    names |= {"NS": "num_state", "NO": "num_output"}
    read_as(entry, CONTROL_STATE_EQN, names, as_attributes(user, "usrsub"))


_DISCRETE = "discrete states are documented but not built yet"
GSE = AdmStatement(
    "GSE",
    {
        **_ID,
        "X": Spec(ID, required=True),
        **{name: Spec(ID) for name in ("U", "Y", "IC")},
        "NS": Spec(COUNT, required=True),
        "NO": Spec(COUNT),
        "FUNCTION": Spec(USER, required=True),
        "ROUTINE": Spec(ROUTINE),
        "STATIC_HOLD": Spec(FLAG),
        "IMPLICIT": Spec(FLAG, refused="implicit equations are not built"),
        **{name: Spec(ANY, refused=_DISCRETE) for name in ("XD", "ND", "ICD", "SAMPLE_FUNCTION")},
    },
    build_general,
    words=_HOLD | {"IMPLICIT": ("IMPLICIT", "TRUE")},
    xml="Control_StateEqn",
)


def build_transfer(entry: Entry) -> None:
    """Add a transfer function."""
    polynomials = {"NUMERATOR": "numerator_coef", "DENOMINATOR": "denominator_coef"}
    read_as(entry, CONTROL_SISO, _ARRAYS | polynomials | {"STATIC_HOLD": "is_static_hold"})


TFSISO = AdmStatement(
    "TFSISO",
    {
        **_ID,
        "X": Spec(ID, required=True),
        "U": Spec(ID, required=True),
        "Y": Spec(ID, required=True),
        "NUMERATOR": Spec(NUMBERS, required=True),
        "DENOMINATOR": Spec(NUMBERS, required=True),
        "STATIC_HOLD": Spec(FLAG),
    },
    build_transfer,
    words=_HOLD,
    xml="Control_SISO",
)

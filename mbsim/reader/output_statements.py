"""ResOutput, H3DOutput, DebugOutput, Messaging: what MotionSolve writes, which moves nothing."""

from __future__ import annotations

from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import COUNT, FLAG, NOT_NEGATIVE, REAL, Kind, keyword
from mbsim.reader.parse import Node
from mbsim.reader.statement import Spec, Statement


def everything(node: Node) -> bool:
    """Return True: no attribute of such a node is looked at."""
    return True


def _flags(**about: str) -> dict[str, Spec]:
    """Return attributes that are TRUE or FALSE."""
    return {name: Spec(FLAG, text) for name, text in about.items()}


def _output(name: str, note: str, attributes: dict[str, Spec]) -> Statement:
    return Statement(name, attributes, in_command=True, note=note)


def _parse_bound(text: str) -> float | bool:
    """Return a number, or TRUE or FALSE, of which dzero is documented as one."""
    if text.lower() in ("true", "false"):
        return bool(FLAG.parse(text))
    return float(NOT_NEGATIVE.parse(text))


_TIMES = keyword(spellings(FIRST="", LAST="", ALL=""))
_STRESSES = keyword(spellings(NONE="", TENSOR=""))
_BOUND = Kind("a number >= 0", _parse_bound)
RES_OUTPUT = _output(
    "ResOutput",
    "result files are mbsim's own (HDF5 and CSV); it sets nothing",
    {
        **_flags(
            mrf_file="whether an MRF file is written",
            abf_file="whether an ABF file is written",
            plt_file="whether a PLT file is written",
        ),
        "abf_unique_time": Spec(_TIMES, "which of several rows of one time ABF has"),
        "plt_unique_time": Spec(_TIMES, "which of several rows of one time PLT has"),
        "angle_type": Spec(keyword(spellings(YPR="", EULER_ANGLES="")), "angles of bodies"),
        **_flags(
            flex_vel_acc_output="velocities of flexible bodies",
            contact_gra_output="forces of each pair of graphics",
            cof_file="whether a COF file is written",
            capture_max_pd="a row where contact is deepest between two",
            req_comment_only="requests are named by their comments alone",
        ),
        **{
            f"{letter}zero": Spec(_BOUND, f"a smaller {what} is written as 0")
            for letter, what in zip(
                "dvaf", ("displacement", "velocity", "acceleration", "force"), strict=True
            )
        },
    },
)
H3D_OUTPUT = _output(
    "H3DOutput",
    "no H3D file is written",
    {
        **_flags(switch_on="whether an H3D file is written"),
        "increment": Spec(COUNT, "every how many rows"),
        "format_option": Spec(
            keyword(spellings(AUTO="", MODAL="", NODAL="", NODALG="")),
            "how flexible bodies are kept",
        ),
        "stress_option": Spec(_STRESSES, "stresses of flexible bodies"),
        "strain_option": Spec(_STRESSES, "strains of flexible bodies"),
        "start_time": Spec(REAL, "time of the first row", "T"),
        "end_time": Spec(REAL, "time of the last row", "T"),
        **_flags(
            elemforce_1d="forces of one-dimensional elements",
            nodal_velocity="velocities of nodes",
            nodal_acceleration="accelerations of nodes",
            linear_animation="mode shapes",
        ),
    },
)
MESSAGING = Statement(
    "Messaging",
    in_command=True,
    note="the log is mbsim's own; it sets nothing",
    any_attribute=everything,
)
DEBUG_OUTPUT = Statement(
    "DebugOutput",
    in_command=True,
    note="the log is mbsim's own; it sets nothing",
    any_attribute=everything,
)
OUTPUT_STATEMENTS = (RES_OUTPUT, H3D_OUTPUT, MESSAGING, DEBUG_OUTPUT)

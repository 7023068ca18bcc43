"""Types of Post_Request: their spellings, what F1..F8 are and what these measure."""

from __future__ import annotations

from typing import NamedTuple


class RequestType(NamedTuple):
    """A type of requests; how its columns are found stands in `results.requests`."""

    columns: tuple[str, ...]  # F1..F8; none where the deck's expressions say it
    measures: tuple[str, ...]  # of F1..F4 and of F5..F8, see `results.quantities`; none likewise
    spellings: str = ""  # others than its name


_FORCES = ("mag", "fx", "fy", "fz", "tmag", "tx", "ty", "tz")
_WRENCH = ("force", "torque")

TYPES = {
    "MARKER_DISPLACEMENT": RequestType(
        ("mag", "x", "y", "z", "angle", "psi", "theta", "phi"),
        ("displacement", "angle"),
        "DISPLACEMENT",
    ),
    "MARKER_VELOCITY": RequestType(
        ("mag", "vx", "vy", "vz", "wmag", "wx", "wy", "wz"),
        ("velocity", "angular_velocity"),
        "VELOCITY",
    ),
    "MARKER_ACCELERATION": RequestType(
        ("mag", "ax", "ay", "az", "alphamag", "alphax", "alphay", "alphaz"),
        ("acceleration", "angular_acceleration"),
        "ACCELERATION",
    ),
    "MARKER_FORCE": RequestType(_FORCES, _WRENCH, "FORCE"),
    "ELEMENTAL_FORCE": RequestType(_FORCES, _WRENCH),
    "EXPRESSION": RequestType((), ()),
}

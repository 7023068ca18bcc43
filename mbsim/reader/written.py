"""Values as a deck has them: numbers that are read as they are, lists with blanks between."""

from __future__ import annotations

import math


def written(value: object) -> str:
    """Return a value as an attribute's text; truth is TRUE or FALSE, infinity INFINITE."""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, str):
        return value
    listed = getattr(value, "tolist", None)  # of NumPy's numbers and arrays
    if listed is not None:
        return written(listed())
    if isinstance(value, (list, tuple)):
        return " ".join(map(written, value))
    if isinstance(value, float) and math.isinf(value):
        return "INFINITE" if value > 0.0 else "-INFINITE"
    return str(value)

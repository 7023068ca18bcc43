"""Sensitivities of a run, as they are read: `results.sensitivity(signal, parameter)`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import UnknownSignal
from mbsim.results.form import plain, values_of
from mbsim.results.names import PARTS

if TYPE_CHECKING:
    from mbsim.results.reading import Results


def derivative(results: Results, name: str, parameter: str) -> Any:
    """Return the derivative of a signal, see `Results.sensitivity`."""
    file, location, part = results.located(name)
    known = results.parameters
    if parameter not in known:
        there = f"; there are {', '.join(known)}" if known else ""
        raise UnknownSignal(
            f"no sensitivity to {parameter}{there}: run it with --sensitivity {parameter}"
        )
    if location is None:
        raise UnknownSignal(f"{name}: no such signal")
    stored = file.get(f"sensitivity/{parameter}/{location.stored}")
    if stored is None:
        raise UnknownSignal(f"{name} has no sensitivity: it is no signal of the motion")
    slope, value = values_of(stored), values_of(file[location.stored])
    if location.column is not None:
        slope, value = slope[:, location.column], value[:, location.column]
    if part is None:
        return plain(slope)
    if part == "mag":
        size = np.linalg.norm(value, axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            return plain(np.einsum("ij,ij->i", value, slope) / size)
    return plain(slope[:, PARTS[slope.shape[1]][part]])

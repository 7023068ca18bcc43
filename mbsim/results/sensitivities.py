"""Sensitivities of a run, as they are read: `results.sensitivity(signal, parameter)`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import UnknownSignal
from mbsim.results.damage import reads
from mbsim.results.form import facts_of, plain, values_of
from mbsim.results.names import PARTS

if TYPE_CHECKING:
    from mbsim.results.reading import Results


class WithSensitivities:
    """What results know of derivatives by parameters of the deck."""

    @property
    @reads
    def parameters(self: Results) -> dict[str, dict[str, Any]]:  # type: ignore[misc]
        """Parameters by which there are derivatives: value, until when they are known, and why."""
        file, *_ = self.located("time")
        group = file.get("sensitivity")
        return {} if group is None else {name: facts_of(item) for name, item in group.items()}

    @reads
    def sensitivity(self: Results, name: str, parameter: str) -> Any:  # type: ignore[misc]
        """Return the derivative of a signal with respect to a parameter of the deck.

        Parameters
        ----------
        name : str
            Of the signal, as `results[...]` takes it.
        parameter : str
            One of those that the run was asked for: ``Force_Contact[301].mu_dynamic``.

        Returns
        -------
        ndarray
            Of the signal's shape, in its unit over the parameter's; NaN from where it is not known.

        Raises
        ------
        UnknownSignal
            If the run has no such derivative.
        """
        file, location, part = self.located(name)
        known = self.parameters
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

"""Sensitivities of a run, as they are read: `results.sensitivity(signal, parameter)`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import UnknownSignal
from mbsim.results.damage import reads
from mbsim.results.form import facts_of
from mbsim.results.names import SENSITIVITY, of_slope
from mbsim.results.signal_index import Location

if TYPE_CHECKING:
    from mbsim.results.reading import Results


class WithSensitivities:
    """What results know of derivatives by parameters of the deck."""

    @property
    @reads
    def parameters(self: Results) -> dict[str, dict[str, Any]]:  # type: ignore[misc]
        """Parameters by which there are derivatives: value, until when they are known, and why."""
        return {name: facts_of(item) for name, item in self._index.parameters().items()}

    def sensitivity(self: Results, name: str, parameter: str) -> Any:  # type: ignore[misc]
        """Return the derivative of a signal with respect to a parameter of the deck.

        It is `results[f"sensitivity/{parameter}/{name}"]` too.

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
        known = self.parameters
        if parameter not in known:
            there = f"; there are {', '.join(known)}" if known else ""
            raise UnknownSignal(
                f"no sensitivity to {parameter}{there}: run it with --sensitivity {parameter}"
            )
        if name not in self:
            raise UnknownSignal(f"{name}: no such signal")
        found = f"{SENSITIVITY}{parameter}/{name.strip('/')}"
        if found not in self:
            raise UnknownSignal(f"{name} has no sensitivity: it is no signal of the motion")
        return self[found]

    def _slope_of_size(self: Results, location: Location, slope: Any) -> Any:  # type: ignore[misc]
        """Return the derivative of a vector's length, (n,), by that of the vector, (n, 3)."""
        _, signal = of_slope(location.stored)
        value = self._values(Location(signal, location.column), None)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.einsum("ij,ij->i", value, slope) / np.linalg.norm(value, axis=1)

"""Responses of a study as a figure: every output over every parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.results.drawing import figure_of_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Most panels beside each other.
MOST_COLUMNS = 6


def draw_responses(
    columns: Mapping[str, Any], parameters: Sequence[str], outputs: Sequence[str], title: str
) -> Figure:
    """Return a figure with a panel for each output (rows) and parameter (columns).

    Parameters
    ----------
    columns : mapping
        Arrays (runs,) by name, and ``status``: runs that warned are drawn otherwise.
    parameters, outputs : sequence of str
        What is drawn over what.
    title : str
    """
    warned = np.asarray(columns["status"]) == "warned"
    panels = [
        [(name, output, columns[name], columns[output], warned) for name in parameters]
        for output in outputs
    ]
    return figure_of_points(panels, title)

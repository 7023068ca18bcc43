"""How large an output's quantity usually is in a model: by that rounding is judged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mbsim.arrays.codes import SCALE_LENGTH, SCALE_SPEED

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.studies.outputs import Output
    from mbsim.studies.study import Study

#: Quantities without a unit whose numbers are of the order of 1, by the last word of a signal.
_OF_ONE = ("quaternion",)
#: Reductions that are times of a run.
_TIMES = ("time_of_max", "time_of_min")


def output_sizes(study: Study, system: System) -> Mapping[str, float]:
    """Return the usual size of each output, in the model's units; 0 where none is known.

    Lengths are those of the model, as errors are judged by (`Scales`), speeds and forces likewise:
    what should be 0, as the way across of a body that moves along, is 0 but for a rounding of
    these.
    """
    return {output.name: _size(output, system) for output in study.outputs}


def _size(output: Output, system: System) -> float:
    """Return the usual size of an output."""
    from mbsim.results.quantities import quantity_in

    if not output.signal or output.reduce in _TIMES:
        return 0.0
    signal = output.signal.replace("/peak_", "/")
    quantity, _ = quantity_in(system.model, signal)
    if any(word in signal.split("/") for word in _OF_ONE):
        return 1.0
    powers = quantity.force, quantity.length, quantity.time, quantity.angle
    if not any(powers):
        return 0.0
    scale = system.scene.world.scale
    length, speed = float(scale[SCALE_LENGTH]), float(scale[SCALE_SPEED])
    force, along, time, _ = powers
    return float(system.load**force * length**along * (length / speed) ** time)

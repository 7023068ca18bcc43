"""`law_picture`: friction laws as curves, over slip speed and through a slip to and fro."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbsim.laws.slip_test import Conditions, Sample, cycle, samples, steady
from mbsim.results.curves import Curve, Panel, Picture
from mbsim.results.units import Quantity

_SLIDING = Quantity("Friction over normal force")
_TO_AND_FRO = Quantity("Friction on I over normal force")


def law_picture(laws: Sequence[Sample], at: Conditions, notes: Sequence[str]) -> Picture:
    """Return two panels: friction after a long slide over slip speed, and force over slip."""
    sliding = Panel(_SLIDING, "", axis=_SLIDING.name, over="slip speed of a long slide")
    loop = Panel(_TO_AND_FRO, "", axis=_TO_AND_FRO.name, over="slip to and fro")
    for k, law in enumerate(laws):
        speeds = samples(law, at)
        friction = steady(law, at, speeds)
        sliding.curves.append(Curve(0, law.name, law.name, np.array(speeds), np.array(friction)))
        x, force = cycle(law, at)
        loop.curves.append(Curve(0, f"{law.name} {k}", law.name, np.array(x), np.array(force)))
    title = "Friction: " + ", ".join(law.name for law in laws)
    return Picture(title, [""], "", False, None, [], list(notes), [sliding, loop])

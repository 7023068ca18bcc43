"""What is told of shapes that overlap at the start."""

from __future__ import annotations

from types import SimpleNamespace as Some

import numpy as np
import pytest

from mbsim.arrays.codes import ACTIVE
from mbsim.dynamics.contact.forces import IGNORE_DEEPER
from mbsim.geometry.catalog import AT_DEPTH
from mbsim.run.start import overlaps


@pytest.mark.parametrize(
    ("depth", "ignored_above", "logged", "told", "faults"),
    [
        (0.0, np.inf, 0, 0, 0),
        (1e-13, np.inf, 0, 0, 0),
        (1e-9, np.inf, 1, 0, 0),
        (0.2, np.inf, 1, 1, 0),
        (0.9, np.inf, 1, 1, 1),
        # deactivated: every depth is deeper than what it ignores
        (0.9, -1.0, 0, 0, 0),
    ],
)
def test_depths_of_rounding_are_not_told(depth, ignored_above, logged, told, faults):
    counts = np.zeros(ACTIVE + 1, dtype=int)
    counts[ACTIVE] = 1
    one, points = np.zeros(1, dtype=int), np.zeros((1, AT_DEPTH + 1))
    points[0, AT_DEPTH] = depth
    pairs = Some(
        active=one, count=counts, slot=one, last=one + 1, kind=one, graphic_i=one, graphic_j=one + 1
    )
    scene = Some(
        pairs=pairs,
        work=Some(points=points, beyond=np.zeros(1, dtype=int)),
        slots=Some(pair=one),
        contacts=Some(numbers=np.full((1, IGNORE_DEEPER + 1), ignored_above)),
        kinds=Some(whole=np.zeros(1), step=np.ones(1, np.int64), contact=one),
        graphics=Some(half=np.array([[0.5, 0.5, 0.5], [1.0, 1.0, 2.0]]), width=[0.5, 1.0]),
    )
    contact = Some(id=1, ignore_penetration_larger_than=None, source=Some(line=3))
    model = Some(contacts={1: contact}, file="deck.xml")
    system = Some(scene=scene, model=model, graphic_ids=[10, 20], contact_ids=[1])
    log, tell = [], []
    found = overlaps(system, log.append, tell.append)
    assert (len(log), len(tell), len(found)) == (logged, told, faults)

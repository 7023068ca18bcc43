"""Rebound of an oblique impact against its table, by what the spring of STICTION is told.

python -m pytest -m bench -s tests/bench/test_oblique_errors.py
"""

from __future__ import annotations

import math

import pytest

from helpers.oblique_impact import MU, TABLE, E, rebound

pytestmark = pytest.mark.bench
SPRINGS = {
    "kept stretch, undamped": 'tangential_damping="0" incremental="FALSE"',
    "default, undamped": 'tangential_damping="0"',
    "default": "",
}


@pytest.mark.parametrize("name", SPRINGS)
def test_rebound_over_the_table(name, tmp_path):
    print(f"\n{name}")
    for angle, measured in TABLE.items():
        back, _ = rebound(tmp_path, angle, SPRINGS[name])
        slides = 1 - MU * (1 + E) / math.tan(math.radians(angle))
        print(
            f"{angle:5} degrees: {back:.4f}, {100 * (back / measured - 1):+.2f} % of the table"
            + (f", {100 * (back / slides - 1):+.3f} % of the closed form" if angle > 33 else "")
        )
        assert 0.0 < back < 1.0

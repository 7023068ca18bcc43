"""Decks whose lengths, masses and times are far apart are refused in words, or run."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from helpers.folders import MODELS
from mbsim import read_model, simulate
from mbsim.errors import MbsimError


@pytest.mark.parametrize("value", ["99999999999", "1e150", "-1e300", "1e-300"])
@pytest.mark.parametrize(
    "attribute", ["pos_x", "pos_z", "mass", "inertia_yy", "w_ic_y", "v_ic_x", "theta"]
)
def test_a_mechanism_with_one_number_far_off(tmp_path: Path, attribute: str, value: str) -> None:
    text = (MODELS / "slider_crank.xml").read_text(encoding="utf-8")
    changed, count = re.subn(rf'(\b{attribute})="[^"]*"', rf'\1="{value}"', text, count=1)
    assert count
    path = tmp_path / "deck.xml"
    path.write_text(changed, encoding="utf-8")

    def enough(time: float, step: float, end: float) -> None:
        raise TimeoutError

    try:
        with simulate(read_model(path), end_time=1e-3, progress=enough) as results:
            assert all(np.isfinite(results[name]).all() for name in results.signals())
    except TimeoutError:
        pass
    except MbsimError as error:
        assert re.search(r"[a-z]{4}", str(error))

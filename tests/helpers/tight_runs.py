"""Derivatives of signals by a parameter, as differences of two runs of a tight tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np

import mbsim


def differences(
    deck: str, name: str, value: float, step: float, signals: tuple[str, ...], **how: Any
) -> dict[str, np.ndarray]:
    """Return central differences, signal by signal: the parameter is `value` +- `step`.

    `how` are options of both runs, whose tolerance is 1e-12 where they do not give another.
    """
    how = {"tol": 1e-12} | how
    up, down = (
        mbsim.simulate(deck, overrides={name: value + side * step}, **how) for side in (1.0, -1.0)
    )
    return {signal: (up[signal] - down[signal]) / (2.0 * step) for signal in signals}

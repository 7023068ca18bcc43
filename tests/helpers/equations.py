"""Hooks of a problem that has none of its own, and what is known of test equations."""

from __future__ import annotations

import math

import numpy as np


def zero(context, t, h, a, b):
    return 0


def one(context, t, h, a, b):
    return 1.0


def none(context, t, h, a, b):
    return -1.0


def far(context, t, h, a, b):
    return 1e300


def observed(errors):
    """Return the order between the first and the last of (h, error)."""
    (h0, e0), (h1, e1) = errors[0], errors[-1]
    return math.log(e0 / e1) / math.log(h0 / h1)


def oscillation(t):
    # y'' = -y + sin 2t, y(0) = 1, y'(0) = 0
    return np.cos(t) + 2.0 / 3.0 * np.sin(t) - np.sin(2.0 * t) / 3.0

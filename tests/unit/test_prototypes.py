"""Copies of groups of arrays: one that is changed leaves the others as they are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mbsim.core.prototypes import copied, copies


class Inner(NamedTuple):
    a: Any


class Outer(NamedTuple):
    inner: Inner
    b: Any
    none: Any


made = []


@copies
def group(n):
    made.append(n)
    return Outer(Inner(np.arange(n)), np.ones((n, 2)), np.zeros((0, n)))


def test_copies_are_made_once_and_are_their_own():
    first, second, other = group(3), group(3), group(4)
    assert made == [3, 4]
    first.inner.a[:], first.b[:] = 9, 9.0
    assert second.inner.a.tolist() == group(3).inner.a.tolist() == [0, 1, 2]
    assert (second.b == 1.0).all()
    assert first.none is second.none
    assert other.b.shape == (4, 2)


def test_groups_without_names_are_copied_too():
    whole = (Inner(np.zeros(2)), np.zeros(1))
    inner, b = copied(whole)
    inner.a[0] = b[0] = 1.0
    assert whole[0].a[0] == whole[1][0] == 0.0

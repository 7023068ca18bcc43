"""Elements, rows and lengths of arrays as they are lowered here give what NumPy gives."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from mbsim.core import compiling, linking

compiling.register()
pytestmark = pytest.mark.skipif(linking.POLICY == "all", reason="Numba's own linking")

KINDS = (np.float64, np.int64, np.bool_, np.complex128, np.uint8, np.float32)


@njit
def taken(a, b, c, k, u):
    return (
        (a[k], a[-k - 1], a[u], b[k, -1], b[u, k], c[k, -2, u], c[-1, k, 0]),
        (len(a), len(b), len(c), a.shape, b.shape, c.shape, b.shape[1]),
        (b[k], b[-1], c[k], c[-1, k], c[u]),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_elements_rows_and_lengths(kind):
    random = np.random.default_rng(3)
    a, b, c = ((9 * random.normal(size=n)).astype(kind) for n in (3, (3, 4), (3, 4, 2)))
    items, lengths, rows = taken(a, b, c, 1, np.uint64(1))
    assert items == taken.py_func(a, b, c, 1, 1)[0]
    assert lengths == (3, 3, 3, (3,), (3, 4), (3, 4, 2), 4)
    for row, wanted in zip(rows, taken.py_func(a, b, c, 1, 1)[2], strict=True):
        assert np.array_equal(row, wanted)
        assert row.strides == wanted.strides
        assert row.flags.c_contiguous
        assert np.shares_memory(row, wanted)


def fill(a, b, c, k, x):
    a[k] = x
    a[-1] = k
    b[k, -2] = 2 * x
    b[-1][k] = x
    c[k, 0, -1] = x
    c[0][-1][k] = k
    b[0] = a[0]
    c[1, 2] = x
    c[-1, :, 0] = k


@pytest.mark.parametrize("kind", KINDS[:4])
@pytest.mark.parametrize("order", ["C", "F", "strided"])
def test_what_is_set_is_where_numpy_sets_it(kind, order):
    def arrays():
        made = [np.ones(shape, dtype=kind) for shape in (3, (3, 4), (3, 4, 2))]
        if order == "F":
            return [np.asfortranarray(each) for each in made]
        if order == "strided":
            return [np.repeat(each, 2, axis=0)[::2] for each in made]
        return made

    found, wanted = arrays(), arrays()
    njit(fill)(*found, 1, kind(2))
    fill(*wanted, 1, kind(2))
    for one, other in zip(found, wanted, strict=True):
        assert np.array_equal(one, other)


def test_a_row_keeps_the_array_that_it_is_of():
    @njit
    def last_row(n):
        a = np.ones((n, 3))
        a[-1] = 7.0
        return a[n - 1]

    for _ in range(100):
        assert np.array_equal(last_row(50), [7.0, 7.0, 7.0])


def test_masks_lists_of_indices_and_slices_are_numbas_own():
    @njit
    def chosen(a, which, mask):
        return a[which], a[mask], a[1:3], a[:, 1], a[1, ::2], a[..., 0]

    a = np.arange(12.0).reshape(4, 3)
    which, mask = np.array([2, 0]), np.array([True, False, True, True])
    for found, wanted in zip(chosen(a, which, mask), chosen.py_func(a, which, mask), strict=True):
        assert np.array_equal(found, wanted)

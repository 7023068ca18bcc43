"""Numbers of a view: quantised, packed, thinned, and read again as a page reads them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from mbsim.view import run_data as data
from mbsim.view.channels import bytes_apart, extreme_rows, shortened
from mbsim.view.motion import Poses, between, continuous
from mbsim.view.packing import MOST_STEPS, from_planes, pack, planes, quantised, unpack
from mbsim.view.thinning import error, kept_rows

_SEEDS = some.integers(0, 2**32 - 1)


@given(_SEEDS, some.floats(1e-9, 1e6))
def test_a_quantised_number_is_off_by_half_a_step(seed, step):
    values = np.random.default_rng(seed).normal(size=(20, 3)) * 1000.0 * step
    # and by rounding
    assert np.abs(quantised(values, step) * step - values).max() <= 0.5 * step * (1.0 + 1e-9)


@pytest.mark.parametrize("value", [np.nan, np.inf, 2.0 * MOST_STEPS])
def test_what_has_no_step_is_refused(value):
    with pytest.raises(ValueError, match="not finite, or too far"):
        quantised(np.array([0.0, value]), 1.0)


@given(
    _SEEDS, some.integers(1, 40), some.integers(1, 7), some.sampled_from([1, 300, MOST_STEPS // 2])
)
def test_planes_are_read_again(seed, rows, columns, size):
    table = np.random.default_rng(seed).integers(-size, size, (rows, columns), np.int32)
    found, count, order = planes(table)
    np.testing.assert_array_equal(from_planes(found, count, order, rows, columns), table)


def test_smooth_motion_takes_few_bytes():
    t = np.linspace(0.0, 1.0, 300)
    table = quantised(np.column_stack([t**2, np.sin(7.0 * t)]), 1e-5)
    found, _, order = planes(table)
    assert order == 2
    assert len(pack({}, {"t": found})) < table.nbytes / 4


def test_a_pack_is_read_again():
    arrays = {
        "a": np.arange(5, dtype=np.uint8),
        "b": np.array([-1, 2**30], np.int32),
        "c": np.array([1.5], np.float32),
        "d": np.zeros(0, np.uint32),
    }
    about, found = unpack(pack({"name": "π </script>"}, arrays))
    assert about == {"name": "π </script>"}
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
    with pytest.raises(TypeError, match="no type of a pack"):
        pack({}, {"x": np.zeros(1)})


@given(_SEEDS)
@settings(max_examples=30)
def test_thinned_rows_are_within_the_tolerance(seed):
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.1, 1.0, 80))
    p = np.cumsum(random.normal(size=(80, 2, 3)), axis=0)
    q = np.cumsum(0.05 * random.normal(size=(80, 2, 4)), axis=0)
    q[..., 0] += 1.0
    poses = Poses(p, q / np.linalg.norm(q, axis=2, keepdims=True))
    reach = np.array([0.5, 2.0])
    rows = kept_rows(time, poses, reach, 2.0)
    assert rows[0] == 0
    assert rows[-1] == 79
    assert (np.diff(rows) > 0).all()
    assert len(rows) < 80
    for first, last in pairwise(rows):
        assert error(time, poses, reach, first, last) <= 2.0


def test_straight_motion_needs_its_ends():
    time = np.linspace(0.0, 1.0, 101)
    p = np.zeros((101, 1, 3))
    p[:, 0, 0] = 3.0 * time
    q = np.zeros((101, 1, 4))
    q[..., 0] = 1.0
    assert kept_rows(time, Poses(p, q), np.ones(1), 1e-9).tolist() == [0, 100]
    assert kept_rows(time[:1], Poses(p[:1], q[:1]), np.ones(1), 1e-9).tolist() == [0]


def test_the_error_of_a_turn_is_that_of_the_farthest_point():
    # a turn by 0.4 rad about z, the middle row being ahead by 0.01 rad
    angles = np.array([0.0, 0.21, 0.4])
    q = np.zeros((3, 1, 4))
    q[:, 0, 0], q[:, 0, 3] = np.cos(angles / 2), np.sin(angles / 2)
    poses = Poses(np.zeros((3, 1, 3)), q)
    found = error(np.array([0.0, 1.0, 2.0]), poses, np.array([5.0]), 0, 2)
    assert found == pytest.approx(5.0 * 0.01, rel=1e-3)


def test_quaternions_do_not_jump():
    angles = np.linspace(0.0, 9.0, 50)
    q = np.zeros((50, 1, 4))
    q[:, 0, 0], q[:, 0, 1] = np.cos(angles / 2), np.sin(angles / 2)
    broken = q.copy()
    broken[::3] *= -1.0
    found = continuous(broken)
    assert ((found[1:] * found[:-1]).sum(axis=2) > 0.9).all()
    half = between(Poses(np.zeros((50, 1, 3)), found), 0, 1, np.array([0.5]))
    assert np.linalg.norm(half.q) == pytest.approx(1.0)


def test_shortened_numbers_keep_three_digits():
    values = np.array([0.0, -1.0, 3.14159265e-7, 6.02e23, np.nan, np.inf])
    found = shortened(values)
    np.testing.assert_allclose(found[:4], values[:4], rtol=2.0**-13)
    assert np.isnan(found[4])
    assert np.isinf(found[5])
    again = np.ascontiguousarray(bytes_apart(found).reshape(4, -1).T).reshape(-1).view("<f4")
    np.testing.assert_array_equal(again, found)


def test_rows_of_a_long_curve_have_its_peaks():
    values = np.zeros(50_000)
    values[[12_345, 40_001]] = 7.0, -3.0
    rows = extreme_rows(values)
    assert {0, 12_345, 40_001, 49_999} <= set(rows.tolist())
    assert len(rows) <= 4002


def test_a_mesh_is_rounded_to_a_part_of_its_size():
    vertices = np.random.default_rng(1).normal(size=(100, 3)).astype("f4")
    far = np.abs(vertices).max()
    assert np.abs(data.shortened_vertices(vertices) - vertices).max() <= far * 2.0**-17 * 1.01
    assert not data.shortened_vertices(np.zeros((2, 3), "f4")).any()

"""Bands and Sobol indices of tables whose distributions and indices are known in closed form."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mbsim.errors import ModelError
from mbsim.studies import designs
from mbsim.studies.distributions import Spread
from mbsim.studies.study import read_study
from mbsim.studies.uncertainty import (
    bands,
    independent,
    lines_of,
    sobol_indices,
    uncertainty,
    warnings_of,
)

FLAT = Spread("uniform", {"low": -math.pi, "high": math.pi})
NAMES = ["a", "b", "c"]


def saltelli(blocks, seed=5, spread=FLAT):
    return SimpleNamespace(
        file="x.toml",
        design="saltelli",
        seed=seed,
        spreads=dict.fromkeys(NAMES, spread),
        runs=5 * blocks,
        outputs=(),
    )


def table(**columns):
    class Table(dict):
        parameters, outputs = NAMES, list(columns)

        def __len__(self):
            return len(next(iter(self.values())))

    return Table(columns, steps=np.full(len(next(iter(columns.values()))), 500))


def test_indices_are_those_that_ishigami_and_homma_give():
    pytest.importorskip("SALib")
    # y = sin a + 7 sin^2 b + 0.1 c^4 sin a: Ishigami & Homma, ISUMA'90 (1990) 398-403
    study = saltelli(2048)
    a, b, c = designs.saltelli(study).T
    y = np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)
    by_b, by_ac = 7.0**2 / 8.0, 8.0 * 0.1**2 * math.pi**8 / 225.0
    by_a = 0.5 * (1.0 + 0.1 * math.pi**4 / 5.0) ** 2
    whole = by_a + by_b + by_ac
    about = uncertainty(study, table(y=y))
    found = about["indices"]["y"]["parameters"]
    first = {"a": by_a / whole, "b": by_b / whole, "c": 0.0}
    total = {"a": (by_a + by_ac) / whole, "b": by_b / whole, "c": by_ac / whole}
    for name in NAMES:
        assert found[name]["first"] == pytest.approx(first[name], abs=0.01)
        assert found[name]["total"] == pytest.approx(total[name], abs=0.01)
        assert abs(found[name]["first"] - first[name]) < found[name]["first_95"]
        assert abs(found[name]["total"] - total[name]) < found[name]["total_95"]
    # 3.5 is the mean; of 2 draws a block
    band = about["bands"]["y"]
    assert band["used"] == 4096
    assert abs(band["mean"] - 3.5) < 2.0 * band["mean_se"]
    assert band["sd"] == pytest.approx(math.sqrt(whole), rel=0.02)
    assert not about["indices"]["y"]["converged"]
    assert "have not converged" in warnings_of(about)[0]
    assert sum("total" in line or " a " in line for line in lines_of(about)) == 2


def test_the_design_is_salibs():
    sobol = pytest.importorskip("SALib.sample.sobol")
    problem = {"num_vars": 3, "names": NAMES, "bounds": [[0.0, 1.0]] * 3}
    theirs = sobol.sample(problem, 32, calc_second_order=False, seed=np.random.default_rng(5))
    ours = designs.saltelli(saltelli(32, spread=Spread("uniform", {"low": 0.0, "high": 1.0})))
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-15)


def test_bands_of_a_normal_distribution_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    held = np.zeros(5)
    errors = []
    for _ in range(300):
        x = 3.0 + 2.0 * rng.standard_normal(100)
        x[7] = np.nan
        found = bands(x)
        assert (found["used"], found["missing"]) == (99, 1)
        held[0] += abs(found["mean"] - 3.0) < 1.96 * found["mean_se"]
        held[1] += abs(found["sd"] - 2.0) < 1.96 * found["sd_se"]
        for k, (each, u) in enumerate(
            zip(found["quantiles"], (-1.644854, 0.0, 1.644854), strict=True)
        ):
            low, high = each["interval_95"]
            held[2 + k] += low <= 3.0 + 2.0 * u <= high
            errors.append(each["value"] - 3.0 - 2.0 * u)
    assert (held / 300 > 0.91).all()
    assert abs(np.mean(errors)) < 0.03


def test_what_has_no_band_and_no_indices_says_why():
    study = saltelli(16)
    y = designs.saltelli(study)[:, 0]
    gaps = y.copy()
    gaps[[0, 6]] = np.nan  # 6 is a mixed run of the second block
    about = uncertainty(study, table(y=gaps, same=np.full(80, 0.1), none=np.full(80, np.nan)))
    why = {name: each["reason"] for name, each in about["indices"].items()}
    assert why["y"] == "2 of 80 runs have no value; the design needs all"
    assert why["same"] == "all runs have the same value"
    assert (about["bands"]["y"]["used"], about["bands"]["y"]["missing"]) == (31, 1)
    assert about["bands"]["same"]["sd_se"] == 0.0
    assert about["bands"]["none"]["reason"] == "a band needs 2 runs; 0 of 32 have a value"
    # too few for the outer quantiles
    inside = [each["interval_95"] for each in about["bands"]["y"]["quantiles"]]
    assert [each is None for each in inside] == [True, False, True]
    said = "\n".join(warnings_of(about))
    assert "band of y: 1 of 32 runs have no value" in said
    assert "no Sobol indices of y: 2 of 80" in said
    assert "no band of none" in said
    assert "[none]" in "\n".join(lines_of(about))


def test_indices_do_not_depend_on_units_and_are_the_same_each_time():
    pytest.importorskip("SALib")
    study = saltelli(64, seed=0)
    a, b, _ = designs.saltelli(study).T
    first = sobol_indices(a + 2.0 * b, NAMES, 0)
    assert sobol_indices(a + 2.0 * b, NAMES, 0) == first
    for unit in (2.0**-900, 2.0**900):
        assert sobol_indices(unit * (a + 2.0 * b), NAMES, 0) == first
    assert bands(2.0**900 * a)["sd"] == 2.0**900 * bands(a)["sd"]


def test_what_varies_by_rounding_is_not_seen():
    pytest.importorskip("SALib")
    study = saltelli(64)
    a, b, _ = designs.saltelli(study).T
    steps = 1000
    bound = 64.0 * 2.0**-52 * steps
    # beside what the model's quantities are, and beside its own size
    assert "not seen" in sobol_indices(0.1 * bound * a, NAMES, 0, 1.0, steps)["reason"]
    assert "not seen" in sobol_indices(1.0 + 0.1 * bound * a, NAMES, 0, 0.0, steps)["reason"]
    # small numbers of which nothing says how large they should be, and what is well above rounding
    assert "parameters" in sobol_indices(0.1 * bound * a, NAMES, 0, 0.0, steps)
    assert "parameters" in sobol_indices(1.0 + 100.0 * bound * a, NAMES, 0, 1.0, steps)
    # rounding that something stiff makes larger: noise, far above the bound
    noise = np.random.default_rng(1).standard_normal(len(a))
    assert "as noise does" in sobol_indices(1.0 + 1e-9 * noise, NAMES, 0, 0.0, steps)["reason"]
    # the same of a tenth of the size is a chaotic output, which varies; a sum is no noise
    assert "parameters" in sobol_indices(1.0 + 0.1 * noise, NAMES, 0, 0.0, steps)
    assert "parameters" in sobol_indices(1.0 + 1e-9 * (a + b), NAMES, 0, 0.0, steps)


def test_only_draws_count_as_independent():
    study = saltelli(16)
    assert independent(study, np.arange(80.0))[:6].tolist() == [0.0, 4.0, 5.0, 9.0, 10.0, 14.0]
    study.design = "grid"
    assert uncertainty(study, table(y=np.arange(80.0))) is None


@pytest.mark.parametrize(("runs", "better"), [(64, "64"), (81, "64"), (16, "64"), (127, "128")])
def test_runs_that_are_no_whole_blocks_are_said(tmp_path, runs, better):
    text = '[study]\nmodel = "x.xml"\ndesign = "saltelli"\nruns = {}\n[parameters]\n'
    text += 'k = {{ path = "Force_Contact[1].stiffness", low = 1, high = 2 }}\n'
    text += 'm = {{ path = "Force_Contact[1].damping", low = 1, high = 2 }}\n'
    text += '[outputs]\nx = {{ signal = "bodies/2/position/x" }}\n'
    file = tmp_path / "x.toml"
    file.write_text(text.format(runs))
    if runs == 64:
        assert read_study(file).points.shape == (64, 2)
        assert not read_study(file).notes
        file.write_text(text.format(17 * 4))
        assert "runs = 17 x 4" in read_study(file).notes[0]
        return
    with pytest.raises(ModelError, match=f"needs a multiple of 4, .* at least 64; .* {better}$"):
        read_study(file)

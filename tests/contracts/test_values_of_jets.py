"""Every function has two forms, of jets and of numbers: their values are the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbsim.expressions.elementary import CODES, apply
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.values import apply_value

COUNTS = {
    **dict.fromkeys(("ADD", "SUB", "MUL", "DIV", "POW"), (2,)),
    "NEG": (1,),
    **{
        name: tuple(range(function.least, min(len(function.args), function.least + 5) + 1))
        for name, function in FUNCTIONS.items()
        if function.kind is Kind.ELEMENTARY
    },
}


def both(name, args, rates):
    """Return the value by jets and by numbers, NaN where an argument is out of the domain."""
    stack, numbers = np.zeros((len(args), 3)), np.array(args)
    stack[:, 0], stack[:, 1:] = args, rates
    results = []
    for run, at in ((apply, (stack, (0, 0))), (apply_value, (numbers, 0))):
        try:
            assert run(CODES[name], len(args), at[0], len(args)) == 1
            results.append(float(at[0][at[1]]))
        except (ValueError, OverflowError):
            results.append(math.nan)
    return results


def test_every_function_is_compared():
    assert set(COUNTS) == set(CODES)


@pytest.mark.parametrize("name", list(CODES))
def test_numbers_give_the_values_of_jets(name):
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(1000):
        count = int(rng.choice(COUNTS[name]))
        # small whole numbers as well: equal arguments, zeros, ends of ranges
        args = rng.integers(-3, 4, count) / 2 if rng.random() < 0.4 else rng.normal(0, 1.5, count)
        if name in ("STEP", "STEP5", "HAVSIN") and rng.random() < 0.7:
            args[1], args[3] = args[0] - rng.random(), args[0] + rng.random()
        # a power by jets is one by logarithms where its exponent moves
        rates = np.zeros((count, 2)) if name in ("POW", "IMPACT", "BISTOP") else 0.3
        with np.errstate(all="ignore"):
            by_jets, by_numbers = both(name, [float(x) for x in args], rates)
        if math.isfinite(by_jets):
            assert by_numbers == by_jets, (name, args)
            compared += 1
        else:
            assert not math.isfinite(by_numbers), (name, args)
    assert compared > 200

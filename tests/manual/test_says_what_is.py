"""Pages against the program: arguments, counters, methods and statements that they speak of."""

from __future__ import annotations

import inspect
import re

import pytest

import mbsim
from helpers.snippets import ROOT
from mbsim.manual.book import pages
from mbsim.reader.adm.statements import STATEMENTS


@pytest.mark.parametrize("function", [mbsim.simulate, mbsim.open])
def test_every_argument_is_on_the_page_of_the_interface(function):
    text = pages()["reference/python"].text
    for name, argument in inspect.signature(function).parameters.items():
        assert re.search(rf"`{name}`|\({name}[,=]| {name}=", text), name
        if function is mbsim.simulate and argument.default is not argument.empty:
            shown = repr(argument.default).replace("'", '"')
            assert f"{name}={shown}" in re.sub(r"\s+", " ", text), name


@pytest.mark.parametrize("method", ["AUTO", "RADAU5", "MOREAU"])
def test_every_counter_is_on_the_page_of_the_result_file(method):
    text = pages()["reference/results/hdf5"].text
    run = mbsim.simulate(ROOT / "models/bouncing_sphere.xml", integrator=method, end_time=0.01)
    assert not [name for name in run.stats if f"`{name}`" not in text]


@pytest.mark.parametrize("name", list(pages()))
def test_a_table_has_a_head(name):
    """Rows behind an empty line are no table but lines with strokes."""
    lines = re.sub(r"```.*?```", lambda m: "\n" * m[0].count("\n"), pages()[name].text, flags=re.S)
    rows = ["", *lines.splitlines(), ""]
    for k, line in enumerate(rows):
        if line.startswith("|") and not rows[k - 1].startswith("|"):
            assert re.fullmatch(r"\|[\s:|-]+\|?", rows[k + 1]), f"line {k}: {line}"


@pytest.mark.parametrize("name", list(pages()))
def test_no_statement_that_is_read_is_said_not_to_be(name):
    for word in re.findall(r"Adams'\s+`(\w+)`\s+is\s+not", pages()[name].text):
        assert word not in {statement.name for statement in STATEMENTS}, word

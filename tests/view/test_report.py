"""The report of a run: its parts, what is escaped, and the command that repeats it."""

from __future__ import annotations

import re
import shlex

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.decks import GRAVITY, GROUND, contact, sphere, write_deck
from helpers.views import HOSTILE, run_balls
from mbsim.cli.main import main
from mbsim.results.reading import open_results
from mbsim.view.plot_svg import Curve, drawn, ticks
from mbsim.view.report import report


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return run_balls(tmp_path_factory.mktemp("balls"), tol=1e-6)


@pytest.fixture(scope="module")
def text(file):
    with open_results(file) as results:
        return report(results)


def test_it_has_all_parts(text):
    for title in ("Summary", "Warnings", "Motion", "Contacts", "Energy and audit", "Settings"):
        assert f"<h2>{title}</h2>" in text
    assert "Request 7" in text
    assert "balance closes to" in text
    assert text.count("<svg") >= 3
    assert "balls.xml, as it was run" in text


def test_the_deck_is_quoted_and_nothing_of_it_is_markup(text, file):
    assert HOSTILE not in text
    assert "&lt;Force_Gravity grav_z=" in text


def test_the_command_repeats_the_run(text, file, tmp_path):
    at = text.index("mbsim run ")
    words = shlex.split(text[at : text.index("</code>", at)])
    assert words[2:] == [str(file.with_suffix(".xml")), "--integrator", "AUTO", "--tol", "1e-06"]
    done = CliRunner().invoke(main, [*words[1:], "-o", str(tmp_path)])
    assert done.exit_code == 0, done.output
    with open_results(file) as first, open_results(tmp_path / "balls.h5") as second:
        np.testing.assert_array_equal(first["bodies/3/position"], second["bodies/3/position"])


def test_what_has_changed_is_not_quoted(tmp_path):
    file = run_balls(tmp_path)
    deck = file.with_suffix(".xml")
    deck.write_text(deck.read_text() + "<!-- another -->")
    with open_results(file) as results:
        text = report(results)
    assert "has changed since the run" in text
    assert "another --" not in text


def test_the_report_of_a_run_that_failed_says_why(tmp_path):
    (tmp_path / "law.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    raise ValueError('no such surface')\n"
    )
    law = contact(script_name="law.py", cff_type="USERCFF", cff_fnc_name="CFFSUB")
    deck = write_deck(tmp_path, GROUND + sphere(0.2, v=(0.5, 0, 0)) + law + GRAVITY)
    done = CliRunner().invoke(main, ["run", str(deck), "-o", str(tmp_path), "--report"])
    assert done.exit_code == 4
    (made,) = tmp_path.glob("*-report.html")
    assert "ValueError: no such surface" in made.read_text(encoding="utf-8").replace("&#x27;", "'")


def test_run_writes_it(tmp_path):
    file = run_balls(tmp_path)
    folder = tmp_path / "again"
    deck = str(file.with_suffix(".xml"))
    done = CliRunner().invoke(main, ["run", deck, "-o", str(folder), "--report"])
    assert done.exit_code == 0, done.output
    assert (folder / "balls-report.html").is_file()
    done = CliRunner().invoke(main, ["report", str(file), "-o", str(tmp_path / "r.html")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "r.html").stat().st_size > 600_000


def test_ticks_are_round():
    assert ticks(0.0, 1.0) == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert ticks(-3e-7, 9e-7, 3) == pytest.approx([0.0, 5e-7])
    assert ticks(2.0, 2.0) == [2.0]
    assert len(ticks(-1.0, 4.0)) <= 7


def test_curves_end_where_there_is_no_number():
    x = np.arange(6.0)
    y = np.array([0.0, 1.0, np.nan, 2.0, np.inf, 3.0])
    found = drawn([Curve("<b>", x, y)], "a & b", "t")
    assert found.count("<polyline") == 3
    assert "<b>" not in found
    assert "a &amp; b" in found
    assert drawn([Curve("n", x, np.full(6, np.nan))], "a", "t") == ""


def test_error_bars_are_bands_about_their_curves():
    x = np.linspace(0.0, 1.0, 3001)
    error = np.full(3001, 0.1)
    error[1000] = 0.3  # no row is left out
    error[2500:] = np.inf
    found = drawn([Curve("a", x, np.sin(x), error)], "a", "t")
    band = re.search(r'<polygon class="band b0" points="([^"]*)"', found)[1]
    points = np.array([[float(c) for c in p.split(",")] for p in band.split()])
    above, below = np.split(points, 2)
    widths = below[::-1, 1] - above[:, 1]
    assert (widths >= -0.1).all()
    assert widths.max() == pytest.approx(2.9 * np.median(widths), rel=0.2)
    assert above[-1, 0] < 0.9 * 720


def test_the_report_of_a_verified_run_says_how_far_it_is_off(tmp_path):
    file = run_balls(tmp_path, verify=True)
    with open_results(file) as results:
        text = report(results)
        largest = results.errors["requests/7"]
    assert largest.shape[1] == 8
    assert '<polygon class="band' in text
    assert "\u00b1" in text

"""A subroutine that fails wherever it is asked ends the run; one that fails far out does not.

The bodies begin where the failure begins, at gap 0: a step that is short enough ends before
rounding lets them touch, so that it asks nothing and proves nothing.
"""

from __future__ import annotations

import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from helpers.folders import MODELS
from helpers.libraries import compiled, need
from mbsim.cli.main import main
from mbsim.errors import PluginError, SolverError

METHODS = ["AUTO", "DOP853", "VERLET", "RADAU5", "GALPHA"]
CFFSUB = "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n    "
USER = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB"}


def friction(folder, body):
    """Return a ball on a plane at gap 0 with a friction subroutine of this body."""
    (folder / "law.py").write_text(CFFSUB + body + "\n", encoding="utf-8")
    law = contact(damping=50, dmax=1e-3, script_name="law.py", **USER)
    return GROUND + sphere(0.1, v=(0.5, 0, 0)) + law + GRAVITY


def normal(folder, body):
    """Return a ball on a plane at gap 0 with a normal force of this body."""
    (folder / "law.py").write_text(
        "def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, "
        f"iflag):\n    {body}\n",
        encoding="utf-8",
    )
    law = contact(cnf_type="USERCNF", cnf_fnc_name="CNFSUB", script_name="law.py")
    return GROUND + sphere(0.1) + law + GRAVITY


def small(results):
    """Return whether a run ended after few tries."""
    return results["steps"] + results["rejected"] < 200


@pytest.fixture
def counters(monkeypatch):
    """Return the counters of the run that failed."""
    from mbsim.run import loop

    found, kept = {}, loop.Runner.stats

    def stats(self, *arguments):
        found.update(kept(self, *arguments))
        return found

    monkeypatch.setattr(loop.Runner, "stats", stats)
    return found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("raise ValueError('no such surface')", "no such surface"),
        ("return None", "None"),
        ("return [0.0, 0.0]", "2 values"),
        ("return [0.0 / (time * 0.0), 0.0, 0.0]", "ZeroDivisionError"),
        ("return [scipy.hypot(1.0, time), 0.0, 0.0]", "scipy"),
        ("return [nforce * float('nan'), 0.0, 0.0]", "nan"),
    ],
)
def test_friction_that_fails_from_gap_zero_ends_the_run(tmp_path, counters, body, said, method):
    with pytest.raises(PluginError, match=said) as caught:
        run_deck(tmp_path, friction(tmp_path, body), integrator=method)
    assert "law.py" in str(caught.value)
    assert small(counters)


@pytest.mark.parametrize("how", [{}, {"interpret_plugins": True}])
@pytest.mark.parametrize("body", ["return 1.0 / (gap - gap)", "return gap * 1e200 * 1e200 * 0.0"])
def test_a_normal_force_that_fails_from_gap_zero_ends_the_run(tmp_path, counters, body, how):
    with pytest.raises(PluginError, match=r"law\.py"):
        run_deck(tmp_path, normal(tmp_path, body), **how)
    assert small(counters)


def test_a_library_that_gives_nan_from_gap_zero_ends_the_run(tmp_path, counters):
    need("gcc")
    library = compiled(
        tmp_path,
        "void CFFSUB(int *id, double *time, double *par, int *npar, double *loci, double *locj,\n"
        "  double *x, double *xdot, double *nforce, int *dflag, int *iflag, double *result)\n"
        "{ result[0] = result[1] = result[2] = (*nforce - *nforce) / (*nforce - *nforce); }\n",
    )
    law = contact(damping=50, dmax=1e-3, cff_dll_name=library, **USER)
    with pytest.raises(PluginError, match="nan"):
        run_deck(tmp_path, GROUND + sphere(0.1) + law + GRAVITY)
    assert small(counters)


def test_a_force_that_fails_from_where_the_body_begins_ends_the_run(tmp_path, counters):
    (tmp_path / "law.py").write_text(
        "def SFOSUB(id, time, par, npar, dflag, iflag):\n"
        "    z, errflg = py_sysfnc('DZ', [20, 10])\n"
        "    return sqrt(z - 0.1)\n"
    )
    force = (
        '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10" '
        'script_name="law.py" usrsub_fnc_name="SFOSUB" usrsub_param_string="USER(1)"/>'
    )
    with pytest.raises(PluginError, match=r"law\.py"):
        run_deck(tmp_path, GROUND + sphere(0.1) + force + GRAVITY)
    assert small(counters)


def test_an_expression_that_is_no_number_from_gap_zero_ends_the_run(tmp_path, counters):
    force = (
        '<Force_Vector_OneBody id="7" type="ForceOnly" i_marker_id="20" '
        'fx_expression="SQRT(DZ(20,10)-0.1)"/>'
    )
    with pytest.raises(SolverError, match=r"Force_Vector_OneBody\[7\]"):
        run_deck(tmp_path, GROUND + sphere(0.1) + force + GRAVITY)
    assert small(counters)


@pytest.mark.parametrize("method", METHODS)
def test_a_law_that_ends_far_out_is_asked_nearer(tmp_path, method):
    # 40 times the force at rest is never reached, but by trial points far ahead
    body = "return [-0.1 * nforce * xdot[0] / sqrt(4000.0 - nforce), 0.0, 0.0]"
    results = run_deck(tmp_path, friction(tmp_path, body), end_time=0.3, integrator=method)
    assert results["time"][-1] == 0.3


def test_a_slip_speed_of_zero_in_the_divisor_is_said_and_ends_the_run(tmp_path):
    # the ball rolls in the end: a slip of rounding errors, and now and then of 0
    body = (
        "v = sqrt(xdot[0] ** 2 + xdot[1] ** 2)\n"
        "    mu = py_step(v, -0.1, -0.05, 0.1, 0.05, 0)[0]\n"
        "    return [-mu * nforce * xdot[0] / v, -mu * nforce * xdot[1] / v, 0.0]"
    )
    (tmp_path / "law.py").write_text(CFFSUB + body + "\n", encoding="utf-8")
    law = contact(damping=50, dmax=1e-3, script_name="law.py", **USER)
    ball = sphere(0.1 - (9.81 / 1e5) ** (2 / 3), v=(0.1, 0, 0))
    deck = write_deck(tmp_path, GROUND + ball + law + GRAVITY, end_time=100.0)
    done = CliRunner().invoke(main, ["run", str(deck), "-o", str(tmp_path / "out")])
    assert done.exit_code == 4, done.output
    assert "line 4: divides by the slip speed v, which fails at v = 0" in done.output
    assert "law.py:4" in done.output
    with mbsim.open_results(tmp_path / "out/deck.h5") as results:
        assert results.stats["rejected"] < 0.2 * results.stats["steps"] + 20


# what begins each language's friction, and what it returns: no friction, and no number
LANGUAGES = {
    "c": (
        "#include <math.h>\nvoid CFFSUB(int *id, double *time, double *par, int *npar, "
        "double *loci, double *locj,\n  double *x, double *xdot, double *nforce, int *dflag, "
        "int *iflag, double *result)\n{{ result[0] = result[1] = result[2] = 0.0;\n"
        "  if (*time > {after}) result[0] = NAN; }}\n"
    ),
    "f90": (
        "subroutine cffsub(id, time, par, npar, loci, locj, x, xdot, nforce, area, dflag, &\n"
        "    iflag, results)\n  integer :: id, npar\n  logical :: dflag, iflag\n"
        "  double precision :: time, par(*), loci(3), locj(3), x(3), xdot(3), nforce, area\n"
        "  double precision :: results(3)\n  results = 0\n"
        "  if (time > {after}d0) results(1) = sqrt({after}d0 - time)\nend subroutine\n"
    ),
}
OCTAVE = """function f = CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag)
  f = [0, 0, 0];
  if time > {after}
    {what};
  end
end
"""


def until(folder, deck, after):
    """Run a deck whose subroutine fails from a time on; return what the command said."""
    file = write_deck(folder, deck, end_time=0.2)
    done = CliRunner().invoke(main, ["run", str(file), "-o", str(folder / "out")])
    assert done.exit_code == 4, done.output
    with mbsim.open_results(folder / "out/deck.h5") as results:
        assert results.status == "failed"
        # every row before the failure is kept
        assert results["time"][-1] == pytest.approx(after - 0.01, abs=0.0101)
        assert small(results.stats)
    return done.output


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("after", ["-1.0", "0.1"])
def test_a_library_that_fails_from_a_time_on_keeps_what_was_before(tmp_path, language, after):
    library = compiled(tmp_path, LANGUAGES[language].format(after=after), language)
    law = contact(damping=50, dmax=1e-3, cff_dll_name=library, **USER)
    said = until(tmp_path, GROUND + sphere(0.1) + law + GRAVITY, max(float(after), 0.0))
    assert "CFFSUB failed at time" in said
    assert "user.so" in said


@pytest.mark.parametrize(
    ("what", "said"), [("error ('no such surface')", "no such surface"), ("f = [NaN, 0, 0]", "nan")]
)
@pytest.mark.parametrize("after", ["-1.0", "0.1"])
def test_octave_that_fails_from_a_time_on_keeps_what_was_before(tmp_path, what, said, after):
    need("octave-cli")
    (tmp_path / "CFFSUB.m").write_text(OCTAVE.format(after=after, what=what), encoding="utf-8")
    law = contact(damping=50, dmax=1e-3, script_name="CFFSUB.m", interpreter="MATLAB", **USER)
    output = until(tmp_path, GROUND + sphere(0.1) + law + GRAVITY, max(float(after), 0.0))
    assert said in output.lower()
    assert "CFFSUB.m" in output


@pytest.mark.parametrize(
    ("line", "time"),
    [
        ("if time > 0.095: raise ValueError('no such table')", 0.1),
        ("if time > 0.095: undefined_name", 0.1),
        ("if endflg: 1.0 / (time - time)", 0.2),
        ("if time > 0.095: import sys; sys.exit(0)", 0.1),
    ],
)
def test_contact_results_that_fail_keep_the_rows_so_far(tmp_path, line, time):
    (tmp_path / "post.py").write_text(
        f"def CONTACTPOST(id, i_gra_id, j_gra_id, time, par, npar, iflag, endflg):\n    {line}\n",
        encoding="utf-8",
    )
    law = contact(damping=50, dmax=1e-3, cpost_fnc_name="CONTACTPOST", cpost_script_name="post.py")
    said = until(tmp_path, GROUND + sphere(0.1) + law + GRAVITY, time)
    assert f"CONTACTPOST failed at time {time:g}" in said
    assert "post.py:2" in said


@pytest.mark.parametrize(
    ("language", "text", "name"),
    [
        ("c", "#include <stdlib.h>\nvoid CFFSUB(int *id) { if (*id < 0) exit(3); }\n", "exit"),
        ("c", "#include <stdlib.h>\nvoid CFFSUB(int *id) { if (*id < 0) abort(); }\n", "abort"),
        (
            "f90",
            "subroutine cffsub(id)\n integer id\n if (id < 0) stop 3\nend subroutine\n",
            "stop",
        ),
        ("c", "void CFFSUB(int *id) { }\n", ""),
    ],
)
def test_a_library_that_would_end_the_process_is_warned_of(tmp_path, language, text, name):
    from mbsim.plugins.source.shared_library import address_of, read_library

    said = []
    library = read_library(compiled(tmp_path, text, language), "Force_Contact[1]")
    (symbol,) = library.conventions("CFFSUB").values()
    assert address_of(library, symbol, said.append)
    assert len(said) == bool(name)
    for line in said:
        assert ": warning: " in line
        assert name in line.split("which ends")[0]


CHANCE = """
import random

chance = random.Random(1)


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    mu, v = 0.1 + 0.1 * chance.random(), (xdot[0] ** 2 + xdot[1] ** 2) ** 0.5
    part = mu * nforce / max(v, 0.02)
    return [-part * xdot[0], -part * xdot[1], 0.0]
"""


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_implicit_methods_say_so_where_friction_is_chance(method, tmp_path):
    """There is no equation to solve: steps fell to 1e-9 and went on, for ever."""
    plugin = tmp_path / "chance.py"
    plugin.write_text(CHANCE)
    deck = (MODELS / "bowling_ball.xml").read_text()
    path = tmp_path / "deck.xml"
    path.write_text(deck.replace("../userfuncs/coulomb_stribeck.py", "chance.py"))
    with pytest.raises(SolverError, match=r"each time they are asked for.*chance"):
        mbsim.simulate(mbsim.read_model(path), integrator=method, plugins=[plugin])

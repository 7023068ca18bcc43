"""CFFSUB in C and Fortran: the same motion as in Python, the documented arguments, clear errors."""

from __future__ import annotations

import ctypes
import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import GRAVITY, GROUND, assert_same, contact, run_deck, sphere, write_deck
from helpers.folders import MODELS, USERFUNCS
from helpers.libraries import compiled, example
from mbsim.cli.main import main
from mbsim.errors import Interrupted, ModelError, PluginError
from mbsim.plugins import load_friction

USER = {"cff_type": "USERCFF", "cff_param_string": "USER(0.05,0.01,0.1,0.5)"}
ARGUMENTS = """int *id, double *time, double *par, int *npar, double *loci, double *locj,
  double *x, double *xdot, double *nforce, int *dflag, int *iflag, double *result"""


def ball_on_plane(**law):
    return (
        GROUND
        + sphere(0.098, v=(0.5, 0.2, 0.0), w=(0.1, 0.2, 3.0))
        + contact(damping=50, dmax=1e-3, **law)
        + GRAVITY
    )


@pytest.mark.parametrize("source", ["cffsub.c", "cffsub.f90"])
def test_the_same_law_gives_the_same_motion_in_every_language(tmp_path, source):
    def run(plugin, **how):
        model = mbsim.read_model(MODELS / "seed_contact.xml")
        return mbsim.simulate(model, end_time=4.0, tol=1e-9, plugins=[plugin], **how)

    python = run(USERFUNCS / "coulomb_stribeck.py")
    interpreted = run(USERFUNCS / "coulomb_stribeck.py", interpret_plugins=True)
    library = run(example(tmp_path, source))
    assert_same(python, interpreted, 1e-12)
    assert_same(python, library, 1e-12)
    # it slips, and no longer at the end
    slip = python["contacts/301001/slip_speed"]
    assert slip.max() > 0.1


EVERY_C = f"""void EVERY({ARGUMENTS})
{{
    int k;
    double sum = *time + 1e-3 * *npar + 1e-6 * *id;
    for (k = 0; k < *npar; ++k) sum += (k + 1) * par[k];
    for (k = 0; k < 3; ++k) sum += (k + 1) * (3 * loci[k] + 5 * locj[k] + 7 * x[k]);
    result[0] = -*nforce * xdot[0] * sum;
    result[1] = -*nforce * xdot[1] * sum;
    result[2] = -0.01 * xdot[2] * sum;
    par[0] = par[1] = 1e9;
}}
"""
EVERY_F = """subroutine every(id, time, par, npar, loci, locj, x, xdot, nforce, area, dflag, &
                 iflag, results)
    implicit none
    integer :: id, npar, k
    double precision :: time, par(npar), loci(3), locj(3), x(3), xdot(3), nforce, area
    logical :: dflag, iflag
    double precision :: results(3), total
    total = time + 1d-3 * npar + 1d-6 * id + area
    do k = 1, npar
        total = total + k * par(k)
    end do
    do k = 1, 3
        total = total + k * (3 * loci(k) + 5 * locj(k) + 7 * x(k))
    end do
    results(1) = -nforce * xdot(1) * total
    results(2) = -nforce * xdot(2) * total
    results(3) = -0.01d0 * xdot(3) * total
    par = 1d9
end subroutine every
"""
EVERY_PY = """def EVERY(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    total = time + 1e-3 * npar + 1e-6 * id
    for k in range(npar):
        total += (k + 1) * par[k]
    for k in range(3):
        total += (k + 1) * (3 * loci[k] + 5 * locj[k] + 7 * x[k])
    force = -nforce * total
    return [force * xdot[0], force * xdot[1], -0.01 * xdot[2] * total]
"""


@pytest.mark.parametrize(("language", "text"), [("c", EVERY_C), ("f90", EVERY_F)])
def test_every_argument_arrives(tmp_path, language, text):
    (tmp_path / "every.py").write_text(EVERY_PY)
    compiled(tmp_path, text, language, "every")
    law = {"cff_type": "USERCFF", "cff_fnc_name": "EVERY", "cff_param_string": "USER(0.2,0.1)"}

    def run(**where):
        return run_deck(tmp_path, ball_on_plane(**law, **where), 0.3, tol=1e-9)

    assert_same(run(script_name="every.py"), run(cff_dll_name="every.so"), 1e-12)


def test_flags_are_those_of_the_call(tmp_path):
    # 100 calls with iflag would be seen as a force of 100; dflag has its own count
    compiled(
        tmp_path,
        f"""int counts[4];
void COUNTING({ARGUMENTS})
{{
    if (*iflag) counts[0] += 1 + 1000 * (*dflag != 0) + 1000 * (xdot[0] != 0.0);
    else if (*dflag) counts[1] += 1;
    else counts[2] += 1;
    result[0] = -0.1 * *nforce * xdot[0]; result[1] = -0.1 * *nforce * xdot[1]; result[2] = 0.0;
}}
""",
        name="counting",
    )
    law = {**USER, "cff_fnc_name": "COUNTING", "cff_dll_name": "counting.so"}

    model = mbsim.read_model(write_deck(tmp_path, ball_on_plane(**law), 0.2))
    counts = (ctypes.c_int * 4).in_dll(ctypes.CDLL(str(tmp_path / "counting.so")), "counts")

    # before the run: once with iflag, and as for derivatives to see whether it reads x
    load_friction(model.contacts[301])
    once, before, calls, _ = counts
    assert (once, calls) == (1, 0)
    assert before > 0

    def counted(integrator):
        counts[:] = [0, 0, 0, 0]
        stats = mbsim.simulate(model, integrator=integrator).stats
        assert counts[0] == 1
        return counts[1] - before, counts[2], stats["friction_calls"]

    derivatives, calls, together = counted("DOPRI5")
    assert (derivatives, calls) == (0, together)
    derivatives, calls, together = counted("RADAU5")
    # differences by slip, spin and normal force, and by X
    assert derivatives == 18 * (derivatives // 18) > 0
    assert calls + derivatives == together


def test_the_languages_agree_where_contacts_come_and_go(tmp_path):
    # a box that spins, slides and rocks: X would be part of the error if the law read it
    box = """<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01"
      inertia_zz="0.01" v_ic_x="1" v_ic_x_flag="TRUE" w_ic_z="3" w_ic_z_flag="TRUE"/>
    <Reference_Marker id="20" body_id="2" pos_z="0.15"/>
    <Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
      length_x="0.2" length_y="0.2" length_z="0.2"/>"""
    law = {"cff_type": "USERCFF", "cff_param_string": "USER(0.3,0.2,0.01,0.02)"}
    model = GROUND + box + contact(damping=50, dmax=1e-3, **law) + GRAVITY
    # nobody sees whether a library looks at the time, which bounds steps
    model += '<Param_Transient h_max="0.004"/>'
    model = mbsim.read_model(write_deck(tmp_path, model, 0.5))
    library = example(tmp_path, "cffsub.c")
    for integrator in ("DOPRI5", "RADAU5"):
        one, other = (
            mbsim.simulate(model, plugins=[plugin], integrator=integrator, tol=1e-7)
            for plugin in (USERFUNCS / "coulomb_stribeck.py", library)
        )
        assert one.stats["steps"] == other.stats["steps"]
        assert_same(one, other, 1e-12)


@pytest.mark.parametrize(("force", "reads"), [("xdot[0]", False), ("xdot[0] + x[1]", True),
                                              ("(xdot[0] < 0.01 ? x[0] : 1.0)", True)])  # fmt: skip
def test_reading_x_is_seen(tmp_path, force, reads):
    body = f"result[0] = *nforce * {force}; result[1] = result[2] = 0.0;"
    compiled(tmp_path, f"void CFFSUB({ARGUMENTS}) {{ {body} }}\n")
    deck = write_deck(tmp_path, ball_on_plane(**USER, cff_dll_name="user.so"))
    user = load_friction(mbsim.read_model(deck).contacts[301])
    assert (user.uses_x, user.reads_x) == (True, reads)


def test_results_that_are_no_numbers_stop_the_run(tmp_path):
    body = "if (*time < 0.1) result[0] = result[1] = result[2] = 0.0;"
    compiled(tmp_path, f"void UNSET({ARGUMENTS}) {{ {body} }}\n")
    law = {**USER, "cff_fnc_name": "UNSET", "cff_dll_name": "user.so"}
    with pytest.raises(PluginError, match=r"Force_Contact\[301\]: UNSET failed.*\[nan, nan, nan\]"):
        run_deck(tmp_path, ball_on_plane(**law), 0.3)


def test_a_run_goes_on_with_its_library(tmp_path, monkeypatch):
    library = example(tmp_path, "cffsub.c")
    model = mbsim.read_model(write_deck(tmp_path, ball_on_plane(**USER), end_time=0.5))
    straight = mbsim.simulate(model, plugins=[library])

    def stop(now, step, end):
        if now > 0.1:
            raise Interrupted("enough")

    with monkeypatch.context() as often:
        often.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-5)
        often.setattr("mbsim.run.loop.FIRST_BUDGET", 5)
        with pytest.raises(Interrupted):
            mbsim.simulate(model, plugins=[library], output=tmp_path / "out", progress=stop)
    with mbsim.simulate(model, plugins=[library], output=tmp_path / "out", resume=True) as resumed:
        np.testing.assert_array_equal(resumed["time"], straight["time"])
        np.testing.assert_array_equal(resumed["bodies/2/position"], straight["bodies/2/position"])


def test_the_language_decides_where_the_name_does_not(tmp_path):
    # 12 arguments behind one symbol, 13 behind the other: each sees its own
    text = EVERY_C.replace("EVERY", "BOTH") + EVERY_C.replace("EVERY", "both_").replace(
        "int *dflag", "double *area, int *dflag"
    )
    compiled(tmp_path, text, name="both")
    bound = EVERY_F.replace("iflag, results)\n", "iflag, results) bind(C, name='EVERY')\n", 1)
    compiled(tmp_path, bound, "f90", "bound")
    (tmp_path / "every.py").write_text(EVERY_PY)
    law = {"cff_type": "USERCFF", "cff_fnc_name": "EVERY", "cff_param_string": "USER(0.2,0.1)"}
    python = run_deck(tmp_path, ball_on_plane(**law, script_name="every.py"), 0.1)
    for name, library, language in (
        ("BOTH", "both", "C"),
        ("BOTH", "both", "FORTRAN"),
        ("EVERY", "bound", "fortran"),
    ):
        given = {**law, "cff_fnc_name": name, "cff_dll_name": library, "cff_language": language}
        assert_same(python, run_deck(tmp_path, ball_on_plane(**given), 0.1), 1e-12)


# -- what is refused

BOTH = "void CFFSUB(void) {}\nvoid cffsub_(void) {}\nvoid helper(void) {}\nstatic int own;\n"


@pytest.fixture
def refused(tmp_path):
    """Return a function that gives the message of a run with a library of this source."""
    compiled(tmp_path, BOTH)

    def message(plugins=(), **words):
        law = {**USER, "cff_dll_name": "user.so", **words}
        with pytest.raises(ModelError) as caught:
            run_deck(tmp_path, ball_on_plane(**law), plugins=plugins)
        return str(caught.value)

    return message


def test_symbols_that_fit_twice_or_not_at_all_are_listed(refused):
    said = refused()
    assert "deck.xml:" in said
    assert "defines CFFSUB (C) and cffsub_ (Fortran)" in said
    assert 'cff_language="C" or "FORTRAN" must say which' in said
    said = refused(cff_fnc_name="OTHER")
    assert 'cff_fnc_name="OTHER", neither OTHER (C) nor other_ (Fortran)' in said
    assert "it defines CFFSUB, cffsub_, helper" in said
    said = refused(cff_fnc_name="Other", cff_language="Fortran")
    assert "does not define other_ or Other" in said
    assert 'cff_language="FORTRAN"' in said


def test_check_finds_what_a_run_would_refuse(tmp_path):
    compiled(tmp_path, BOTH)
    law = {**USER, "cff_dll_name": "user", "cff_fnc_name": "OTHER"}
    deck = write_deck(tmp_path, ball_on_plane(**law))
    said = CliRunner().invoke(main, ["check", str(deck)])
    assert said.exit_code == 2
    assert "deck.xml:" in said.stderr
    assert 'cff_fnc_name="OTHER"' in said.stderr
    deck.write_text(deck.read_text().replace("OTHER", "helper"))
    assert CliRunner().invoke(main, ["check", str(deck)]).exit_code == 0


def test_files_that_are_no_libraries_are_refused_with_their_line(refused, tmp_path):
    said = refused(cff_dll_name="nowhere.so")
    assert "deck.xml:" in said
    assert 'cff_dll_name="nowhere.so": no such file' in said
    (tmp_path / "text.so").write_text("no library")
    assert "cannot be loaded" in refused(cff_dll_name="text.so")
    assert 'cff_language="PASCAL"' in refused(cff_language="PASCAL")
    said = refused(cff_dll_name="NULL", plugins=[tmp_path / "missing.so"])
    assert "missing.so: no such file" in said


def test_a_missing_library_of_a_library_is_named(tmp_path):
    text = "void c_sysfnc(void);\n" + f"void CFFSUB({ARGUMENTS}) {{ c_sysfnc(); }}\n"
    compiled(tmp_path, text)
    with pytest.raises(ModelError, match=r"cannot be loaded.*c_sysfnc"):
        run_deck(tmp_path, ball_on_plane(**USER, cff_dll_name="user.so"), 0.1)


def test_plugin_files_of_both_kinds_are_searched(tmp_path):
    library, script = example(tmp_path, "cffsub.c"), tmp_path / "other.py"
    script.write_text("def OTHER(*given):\n    return [0.0, 0.0, 0.0]\n")
    results = run_deck(tmp_path, ball_on_plane(**USER), 0.1, plugins=[script, library])
    assert results["contacts/301/force"][1:, 0].min() < 0.0
    (tmp_path / "twice.py").write_text(EVERY_PY.replace("EVERY", "CFFSUB"))
    with pytest.raises(ModelError, match=r"CFFSUB is defined twice: .*twice.py, .*cffsub_c.so"):
        run_deck(tmp_path, ball_on_plane(**USER), 0.1, plugins=[tmp_path / "twice.py", library])


def test_info_shows_what_subroutines_ask_for(tmp_path):
    (tmp_path / "asks.py").write_text(
        "def CFFSUB(*given):\n    py_sysfnc('DX', [20, 10])\n    return [0.0, 0.0, 0.0]\n"
    )
    deck = write_deck(tmp_path, ball_on_plane(**USER))
    call = CliRunner().invoke

    def about(plugin):
        said = json.loads(call(main, ["info", str(deck), "--json", *plugin]).stdout)
        return said["subroutines"]["Force_Contact[301] cff"]

    assert about([])["file"] == "none; name one with --plugin FILE"
    assert about(["--plugin", str(tmp_path / "asks.py")])["asks_for"] == ["DX 20 10"]
    library = compiled(tmp_path, "void cffsub_(void) {}\n")
    assert about(["--plugin", str(library)])["language"] == "Fortran"

"""Runs as a user starts them: interrupted, resumed, failing, in several parts."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from mbsim.errors import ModelError, PluginError, SolverError

CLI = [sys.executable, "-c", "from mbsim.cli.main import main; main()"]
BOUNCE = GROUND + sphere(0.3, v=(0.5, 0, 0)) + contact(damping=20, dmax=1e-3, **COULOMB) + GRAVITY


def cli(*arguments, **options):
    return subprocess.run(
        [*CLI, *map(str, arguments)], capture_output=True, text=True, timeout=300, **options
    )


def slow_deck(folder):
    """Return a deck whose law is interpreted and counts its calls, so that it runs for long."""
    (folder / "law.py").write_text(
        "import sys\n"
        "calls = []\n"
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    if time > 0.5 and not calls:\n"
        "        calls.append(1)\n"
        "        print('reached 0.5', file=sys.stderr, flush=True)\n"
        "    return [-50.0 * xdot[0] - 10.0 * x[0], -50.0 * xdot[1] - 10.0 * x[1], 0.0]\n",
        encoding="utf-8",
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}
    model = (
        GROUND
        + sphere(0.0995, v=(0.5, 0.1, 0))
        + contact(stiffness=1e7, damping=1e3, dmax=1e-5, **law)
        + GRAVITY
    )
    return write_deck(folder, model, end_time=40.0, print_interval=0.01)


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize(
    ("method", "sent"),
    [
        ("DOPRI5", "SIGINT"),
        *(pytest.param("DOP853", s, marks=pytest.mark.slow) for s in ("SIGTERM", "SIGHUP")),
    ],
)
def test_a_signal_keeps_everything_and_resume_gives_the_same_run(tmp_path, method, sent):
    if sent == "SIGHUP" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        pytest.skip("SIGHUP is switched off (nohup), for what is started here too")
    deck = slow_deck(tmp_path)
    by = ["--integrator", method]
    arguments = ["run", deck, "-o", tmp_path / "a", "--progress", "off", *by]
    process = subprocess.Popen(
        [*CLI, *map(str, arguments)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    for line in process.stderr:
        if "reached 0.5" in line:
            process.send_signal(getattr(signal, sent))
            break
    _, rest = process.communicate(timeout=120)
    assert process.returncode == 128 + getattr(signal, sent), rest
    assert "Traceback" not in rest
    assert "--resume goes on from there" in rest
    with mbsim.open_results(tmp_path / "a/deck.h5") as results:
        assert results.status == "interrupted"
        t = results["time"]
        assert 0.5 <= t[-1] < 40.0
        assert len(results["bodies/2/position"]) == len(t)

    other = cli(
        *arguments, "--resume", "--integrator", "DOPRI5" if method != "DOPRI5" else "DOP853"
    )
    assert other.returncode == 2
    assert f"integrator was {method}" in other.stderr
    resumed = cli(*arguments, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    said = re.search(r"goes on at ([\d.]+) of 40\n", resumed.stderr)
    assert said is not None, resumed.stderr
    assert 0.5 <= float(said[1]) < 40.0
    assert said[0] in (tmp_path / "a/deck.log").read_text()
    straight = cli("run", deck, "-o", tmp_path / "b", *by)
    assert straight.returncode == 0, straight.stderr
    with (
        mbsim.open_results(tmp_path / "a/deck.h5") as a,
        mbsim.open_results(tmp_path / "b/deck.h5") as b,
    ):
        assert a.status == b.status == "finished"
        assert a.stats["steps"] == b.stats["steps"]
        np.testing.assert_array_equal(a["time"], b["time"])
        for name in ("state/y", "contacts/301/force", "energy/dissipated", "events"):
            np.testing.assert_array_equal(a[name], b[name])


def test_resume_of_a_finished_run_is_refused(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    assert cli("run", deck, "-o", tmp_path / "a").returncode == 0
    again = cli("run", deck, "-o", tmp_path / "a", "--resume")
    assert again.returncode == 2
    assert "Traceback" not in again.stderr


def failing_plugin(folder, body):
    (folder / "bad.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        f"    {body}\n",
        encoding="utf-8",
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "bad.py"}
    return write_deck(
        folder,
        GROUND + sphere(0.3, v=(0.5, 0, 0)) + contact(**law) + GRAVITY,
        end_time=1.0,
    )


@pytest.mark.parametrize("flag", [[], ["--interpret-plugins"]])
@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("raise ValueError('no such surface')", "no such surface"),
        ("return [1.0 / (time * 0.0), 0.0, 0.0]", "ZeroDivisionError"),
        ("return [0.0, 0.0]", "2 values"),
        ("return [float('nan'), 0.0, 0.0]", "nan"),
        ("return 'friction'", "friction"),
        ("return None", "None"),
        ("return [sqrt(-nforce), 0.0, 0.0]", "ValueError"),
    ],
)
def test_a_plugin_that_fails_ends_the_run_and_keeps_results(tmp_path, body, said, flag):
    deck = failing_plugin(tmp_path, body)
    done = cli("run", deck, "-o", tmp_path / "out", *flag)
    assert done.returncode == 4, done.stderr
    assert said in done.stderr
    assert "Force_Contact[301]" in done.stderr
    assert "bad.py" in done.stderr
    assert "mbsim/" not in done.stderr.replace("mbsim: error", "")
    with mbsim.open_results(tmp_path / "out/deck.h5") as results:
        assert results.status == "failed"
        # everything before the touch at 0.2 s is there
        assert results["time"][-1] >= 0.19


def test_step_too_small_says_when_why_and_where(tmp_path):
    path = write_deck(tmp_path, BOUNCE, end_time=1.0)
    text = path.read_text().replace("<Simulate", '<Param_Transient h_min="1e-2"/><Simulate')
    path.write_text(text)
    with pytest.raises(SolverError) as caught:
        mbsim.simulate(mbsim.read_model(path))
    message = str(caught.value)
    assert "Force_Contact[301]" in message
    assert "time 0." in message
    done = cli("run", path, "-o", tmp_path / "out")
    assert done.returncode == 3
    with mbsim.open_results(tmp_path / "out/deck.h5") as results:
        assert results.status == "failed"
        assert len(results["time"]) > 10


def test_several_simulates_with_changed_gravity(tmp_path):
    path = tmp_path / "deck.xml"
    model = sphere(0.0)
    path.write_text(
        f"<M><Model>{model}{GRAVITY}</Model><Command>"
        '<Simulate analysis_type="Transient" end_time="1" print_interval="0.25"/>'
        '<Force_Gravity grav_z="0"/>'
        '<Simulate analysis_type="Transient" end_time="2" print_interval="0.25"/>'
        "</Command></M>"
    )
    results = mbsim.simulate(mbsim.read_model(path))
    t = results["time"]
    np.testing.assert_allclose(t, np.arange(9) * 0.25, atol=1e-12)
    z = results["bodies/2/position/z"]
    expected = np.where(t <= 1, -0.5 * 9.81 * t**2, -0.5 * 9.81 - 9.81 * (t - 1))
    np.testing.assert_allclose(z, expected, atol=1e-12)
    # the row at the restart holds the values after it
    a = results["bodies/2/acceleration/z"]
    np.testing.assert_allclose(a, np.where(t < 1 - 1e-9, -9.81, 0.0), atol=1e-12)


def test_end_time_and_print_interval_of_the_caller(tmp_path):
    results = run_deck(tmp_path, BOUNCE, end_time=1.0, print_interval=0.1)
    assert len(results["time"]) == 11
    path = write_deck(tmp_path, BOUNCE, end_time=1.0)
    results = mbsim.simulate(mbsim.read_model(path), end_time=0.35, print_interval=0.1)
    np.testing.assert_allclose(results["time"], [0, 0.1, 0.2, 0.3, 0.35])


def test_deep_overlap_at_the_start_is_refused_unless_allowed(tmp_path):
    model = GROUND + sphere(-0.05) + contact() + GRAVITY
    with pytest.raises(ModelError, match=r"overlap by 0\.15"):
        run_deck(tmp_path, model)
    results = run_deck(tmp_path, model, end_time=0.05, allow_overlap=True)
    assert results["bodies/2/velocity/z"][-1] > 0


def test_shallow_overlap_at_the_start_is_an_incident_at_once(tmp_path):
    results = run_deck(tmp_path, GROUND + sphere(0.0999) + contact() + GRAVITY, end_time=0.1)
    assert results["contacts/301/incidents"][0] == 1
    assert results["contacts/301/force/z"][0] == pytest.approx(1e5 * 1e-4**1.5)
    assert results["events"]["time"][0] == 0.0


def test_ignored_penetration(tmp_path):
    # a sphere that starts deeper than the limit falls through
    law = {"ignore_penetration_larger_than": 0.05}
    model = GROUND + sphere(0.03) + contact(**law) + GRAVITY
    results = run_deck(tmp_path, model, end_time=0.2, allow_overlap=True)
    assert results["bodies/2/position/z"][-1] == pytest.approx(0.03 - 0.5 * 9.81 * 0.04, rel=1e-9)


def test_plugin_error_class_from_python(tmp_path):
    deck = failing_plugin(tmp_path, "return [0.0]")
    with pytest.raises(PluginError, match="1 values"):
        mbsim.simulate(mbsim.read_model(deck))


def test_x_is_the_integral_of_slip_since_touch(tmp_path):
    # a spring on X alone: the ball oscillates about where it touched
    (tmp_path / "spring.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    return [-par[0] * x[0], -par[0] * x[1], 0.0]\n"
    )
    law = {
        "cff_type": "USERCFF",
        "cff_param_string": "USER(40)",
        "cff_fnc_name": "CFFSUB",
        "script_name": "spring.py",
    }
    depth = (9.81 / 1e8) ** (2 / 3)
    # heavy inertia: it slides without turning
    model = (
        GROUND
        + sphere(0.1 - depth, v=(1.0, 0, 0), inertia=1e9)
        + contact(stiffness=1e8, **law)
        + GRAVITY
    )
    results = run_deck(tmp_path, model, end_time=1.0, tol=1e-9)
    t, x = results["time"], results["bodies/2/position/x"]
    omega = 40.0**0.5
    np.testing.assert_allclose(x, np.sin(omega * t) / omega, atol=1e-6)


def test_json_is_one_object_and_nothing_else(tmp_path):
    import json

    deck = write_deck(tmp_path, BOUNCE, end_time=0.3)
    done = cli("run", deck, "-o", tmp_path / "out", "--json")
    assert done.returncode == 0
    answer = json.loads(done.stdout)
    assert answer["status"] == "finished"
    assert answer["end_time"] == 0.3
    assert set(answer["bodies"]["2"]) == {
        "position", "quaternion", "velocity", "angular_velocity",
    }  # fmt: skip
    for name in ("steps", "rejected", "rhs_evaluations", "friction_calls", "wall_s", "compile_s"):
        assert name in answer["stats"]


def test_a_run_that_cannot_begin_leaves_an_earlier_result_alone(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    assert cli("run", deck, "-o", tmp_path / "out").returncode == 0
    before = (tmp_path / "out/deck.h5").read_bytes()
    write_deck(tmp_path, GROUND + sphere(-0.05) + contact() + GRAVITY, end_time=0.1)
    done = cli("run", deck, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert (tmp_path / "out/deck.h5").read_bytes() == before
    assert not list((tmp_path / "out").glob(".*"))


def test_messages_of_a_user_subroutine_are_in_the_log(tmp_path):
    (tmp_path / "law.py").write_text(
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    py_usrmes(1, 'touched', id, 'INFO')\n"
        "    return [0.0, 0.0, 0.0]\n"
    )
    law = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB", "script_name": "law.py"}
    deck = write_deck(tmp_path, GROUND + sphere(0.3) + contact(**law) + GRAVITY, end_time=0.3)
    assert cli("run", deck, "-o", tmp_path / "out").returncode == 0
    text = (tmp_path / "out/deck.log").read_text()
    assert "USRMES:USER [301] INFO: touched" in text


@pytest.mark.parametrize("options", [["--end-time", "inf"], ["--print-interval", "0"]])
def test_times_that_are_no_times_are_refused(tmp_path, options):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    done = cli("run", deck, "-o", tmp_path / "out", *options)
    assert done.returncode == 2
    assert "not allowed" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_standard_output_is_one_message(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*CLI, "run", str(deck), "-o", str(tmp_path / "out")],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 5
    assert "Traceback" not in done.stderr
    with mbsim.open_results(tmp_path / "out/deck.h5") as results:
        assert results.status == "finished"


def test_logged_rebound_is_the_measured_one(tmp_path):
    model = GROUND + sphere(0.2, v=(0, 0, -1.0)) + contact(damping=50, dmax=1e-3)
    results = run_deck(tmp_path, model, end_time=0.5, tol=1e-8, output=tmp_path / "out")
    text = (tmp_path / "out/deck.log").read_text()
    logged = float(text.split("effective rebound, first impact")[1].split()[0])
    assert logged == pytest.approx(results["bodies/2/velocity/z"][-1], rel=1e-4)
    assert logged == pytest.approx(0.4813434809, rel=1e-4)


def test_a_stiff_integrator_of_motionsolve_runs_ours_with_a_word(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    done = cli("run", deck, "-o", tmp_path / "out", "--integrator", "VSTIFF")
    assert done.returncode == 0
    assert "run by RADAU5" in done.stderr


def test_a_run_loads_only_the_method_that_it_uses(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.01)
    code = (
        "import sys, mbsim; mbsim.simulate(mbsim.read_model(sys.argv[1]), integrator=sys.argv[2]); "
        "print([n for n in sys.modules if n.startswith('mbsim.integrators.dop')])"
    )
    for method in ("DOPRI5", "DOP853"):
        done = subprocess.run(
            [sys.executable, "-c", code, str(deck), method], capture_output=True, text=True
        )
        assert done.stdout.strip() == f"['mbsim.integrators.{method.lower()}']", done.stderr


def test_two_methods_in_one_run_are_refused(tmp_path):
    deck = write_deck(tmp_path, BOUNCE, end_time=0.1)
    one, two = (
        f'<Param_Transient integrator_type="{name}"/>'
        f'<Simulate analysis_type="Transient" end_time="{end}" print_interval="0.01"/>'
        for end, name in ((0.05, "DOP853"), (0.1, "DOPRI5"))
    )
    text = deck.read_text(encoding="utf-8")
    begin, end = text.index("<Simulate"), text.index("</Command>")
    deck.write_text(text[:begin] + one + two + text[end:], encoding="utf-8")
    done = cli("run", deck, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "Param_Transient: integrator_type=DOP853 and" in done.stderr
    assert "integrator_type=DOPRI5: one method runs all Simulates" in done.stderr
    assert "Traceback" not in done.stderr


def test_pauses_do_not_change_a_run(tmp_path, monkeypatch):
    from mbsim.run import loop

    ends = []
    for budget in (50, 10**9):
        monkeypatch.setattr(loop, "FIRST_BUDGET", budget)
        results = run_deck(tmp_path, BOUNCE, end_time=1.0, tol=1e-4)
        ends.append([results.stats["steps"], *results["bodies/2/position"][-1]])
    assert ends[0] == ends[1]

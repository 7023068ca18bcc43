"""CONTACTPOST: called at every output time with what the results hold, once before, once after."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from helpers.folders import USERFUNCS
from mbsim.cli.main import main
from mbsim.errors import DeckError, PluginError

WRITES = """import json
lines = []
def POST(id, i_gra_id, j_gra_id, time, par, npar, iflag, endflg):
    n = py_get_ncontacts(id, i_gra_id, j_gra_id)
    net = py_get_contact_post(id, i_gra_id, j_gra_id, 0)
    one = py_get_contact_post(id, i_gra_id, j_gra_id, 1)
    lines.append([id, i_gra_id, j_gra_id, time, par, npar, iflag, endflg, n, net, one])
    if endflg:
        with open(__file__ + ".json", "w") as file:
            json.dump(lines, file)
"""
POST = {"cpost_fnc_name": "POST", "cpost_script_name": "post.py", "cpost_param_string": "USER(1,2)"}


@pytest.fixture
def written(tmp_path):
    """Return a function that runs a deck and returns its results and what POST wrote."""

    def run(model, **settings):
        (tmp_path / "post.py").write_text(WRITES)
        results = run_deck(tmp_path, model, 0.5, 0.01, **settings)
        return results, json.loads((tmp_path / "post.py.json").read_text())

    return run


def test_it_sees_what_the_results_hold(written):
    model = GROUND + sphere(0.2, v=(0.5, 0, 0)) + contact(damping=50, dmax=1e-3, **POST) + GRAVITY
    results, calls = written(model)
    first, *rows, last = calls
    assert first == [301, 200, 100, 0.0, [1.0, 2.0], 2, 1, 0, [0, 1], [[], 1], [[], 1]]
    assert [call[3] for call in rows] == results["time"].tolist()
    assert last[:8] == [*rows[-1][:6], 0, 1]
    assert last[8:] == rows[-1][8:]
    touched = results["contacts/301/incidents"]
    assert 0 < touched.sum() < len(touched)
    for k, (*_, n, net, one) in enumerate(rows):
        assert n == [touched[k], 0]
        assert net[1] == 0
        np.testing.assert_array_equal(net[0][:3], results["contacts/301/force"][k])
        np.testing.assert_array_equal(net[0][3:6], results["contacts/301/torque"][k])
        assert net[0][6] == results["contacts/301/penetration"][k]
        assert net[0][7] == results["contacts/301/slip_speed"][k]
        assert one[1] == (0 if touched[k] else 1)
        if touched[k]:
            depth, x, y, z, *n_and_x = one[0]
            assert depth == net[0][6]
            centre = results["bodies/2/position"][k]
            np.testing.assert_allclose([x, y, z], [*centre[:2], -0.5 * depth], atol=1e-12)
            np.testing.assert_allclose(n_and_x, [0, 0, 1, 0, 0, 0, 0], atol=1e-12)


def test_every_pair_of_graphics_is_asked_for(written):
    balls = sphere(0.0999) + sphere(0.0999, body=3, x=0.199)
    pairs = contact(i="200 300", damping=50, dmax=1e-3, **POST).replace(
        'num_i_graphics="1"', 'num_i_graphics="2"'
    )
    _, calls = written(GROUND + balls + pairs + GRAVITY)
    assert [call[1:3] for call in calls[1:5]] == [[200, 100], [300, 100]] * 2
    assert [call[8] for call in calls[1:3]] == [[1, 0], [1, 0]]


def test_results_are_those_of_a_run_without_it(written, tmp_path):
    model = GROUND + sphere(0.2) + contact(damping=50, dmax=1e-3, **POST) + GRAVITY
    results, _ = written(model)
    for name in POST:
        model = model.replace(f'{name}="{POST[name]}"', "")
    plain = run_deck(tmp_path, model, 0.5, 0.01)
    for name in ("time", "bodies/2/position", "contacts/301/force"):
        np.testing.assert_array_equal(results[name], plain[name])


def test_what_fails_there_stops_the_run(tmp_path):
    (tmp_path / "post.py").write_text(
        "def POST(*given):\n    return 1 / (0 if given[3] > 0.1 else 1)\n"
    )
    model = GROUND + sphere(0.2) + contact(damping=50, dmax=1e-3, **POST) + GRAVITY
    path = write_deck(tmp_path, model)
    with pytest.raises(
        PluginError, match=r"Force_Contact\[301\]: POST failed at time 0.11"
    ) as said:
        mbsim.simulate(mbsim.read_model(path))
    assert "post.py:2" in str(said.value)
    called = CliRunner().invoke(main, ["run", str(path), "-o", str(tmp_path / "out")])
    assert called.exit_code == 4


def test_a_library_that_is_not_there(tmp_path):
    model = GROUND + sphere(0.2) + contact(damping=50, dmax=1e-3, cpost_dll_name="a.so") + GRAVITY
    with pytest.raises(DeckError, match=r"cpost_dll_name.*no such file"):
        run_deck(tmp_path, model)


def test_the_example_prints_a_table(tmp_path, capsys):
    post = {"cpost_fnc_name": "CONTACTPOST", "cpost_script_name": USERFUNCS / "contact_post.py"}
    model = GROUND + sphere(0.0999) + contact(damping=50, dmax=1e-3, **post) + GRAVITY
    run_deck(tmp_path, model, 0.05, 0.01)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("# time")
    assert lines[1].startswith("0 301 200 100 0.0001 0 0 -5e-05")
    assert len(lines) == 7

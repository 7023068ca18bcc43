"""`mbsim run --dump-fclib N`: contacts of a run as frictional contact problems."""

from __future__ import annotations

import math

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.decks import EDGE, GRAVITY, GROUND, contact, cube, sphere, write_deck
from helpers.folders import MODELS
from helpers.rigid_decks import FIXED
from mbsim.cli.main import main
from mbsim.errors import Interrupted, ModelError, ResultsError
from mbsim.fclib import hdf5
from mbsim.fclib.solve import solve

CONTACT = """
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1" damping="100" dmax="1e-5"
  cff_type="STICTION" mu_static="0.6" mu_dynamic="0.5"/>
<Force_Gravity grav_x="2" grav_z="-9.81"/>"""


def run(folder, deck, every=3, **settings):
    out = folder / "out"
    results = mbsim.simulate(mbsim.read_model(deck), output=out, dump_fclib=every, **settings)
    files = sorted(
        (out / "fclib").glob("*.hdf5"), key=lambda path: int(path.name.split("-i")[1].split("-")[0])
    )
    return results, [hdf5.read(path) for path in files], files


def step_of(contents):
    """Return time and step of a problem."""
    words = contents.problem.info.description.replace(",", "").split()
    return float(words[1]), float(words[3])


def test_a_block_at_rest_needs_the_impulse_of_its_weight(tmp_path):
    results, problems, files = run(tmp_path, MODELS / "stiction_incline.xml", every=5, tol=1e-9)
    steps = int(results.stats["steps"])
    at = [int(path.name.split("-i")[1].split("-")[0]) for path in files]
    # one like the last one is not written again
    assert set(at) <= set(range(5, steps + 1, 5))
    assert 5 in at
    last = problems[-1]
    t, h = step_of(last)
    assert t <= 110.0
    assert last.problem.contacts == 4
    assert last.problem.mu == pytest.approx(0.4)
    found = solve(last.problem, tol=1e-10)
    assert found.status == "solved"
    pressed, across = found.r[0::3].sum(), found.r.reshape(4, 3)[:, 1:].sum(axis=0)
    angle = math.radians(20.0)
    assert pressed == pytest.approx(9.81 * h * math.cos(angle), rel=1e-8)
    assert np.hypot(*across) == pytest.approx(9.81 * h * math.sin(angle), rel=1e-8)
    # the run's own forces do the same
    guess = last.guesses[0]
    assert guess.r[0::3].sum() == pytest.approx(pressed, rel=1e-6)
    assert np.abs(guess.u).max() < 1e-6 * np.abs(last.problem.q).max()


def test_a_ball_that_slides_has_its_matrix_in_closed_form(tmp_path):
    deck = write_deck(tmp_path, GROUND + sphere(0.1 - 9.81e-5, v=(1.0, 0, 0)) + CONTACT, 0.05)
    _, problems, _ = run(tmp_path, deck)
    problem, arm = problems[0].problem, 0.1 - 0.5 * 9.81e-5
    turn = arm**2 / (0.4 * 0.1**2)
    wanted = np.diag([1.0, 1.0 + turn, 1.0 + turn])
    np.testing.assert_allclose(problem.W.csr().toarray(), wanted, rtol=1e-5, atol=1e-12)


ROD = """
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="-0.09999"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Reference_Marker id="11" body_id="1" theta="1.5707963267948966"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="20" body_id="2" pos_x="1"/>
<Reference_Marker id="21" body_id="2" theta="1.5707963267948966"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="11"/>
"""


def test_joints_are_in_the_matrix(tmp_path):
    _, problems, _ = run(tmp_path, write_deck(tmp_path, ROD + CONTACT, 0.2))
    W = problems[-1].problem.W.csr().toarray()
    # the rod turns about y: the normal has the arm 1, what lies along x 0.1, along y none
    wanted = np.array([1.0, 0.1**2, 0.0]) / 1.1
    np.testing.assert_allclose(np.diag(W), wanted, atol=2e-3)
    assert np.linalg.matrix_rank(W, tol=1e-9) == 1
    # what the weight alone would make of it in the step
    _, h = step_of(problems[-1])
    assert problems[-1].problem.q[0] == pytest.approx(-9.81 / 1.1 * h, rel=2e-3)
    assert solve(problems[-1].problem, tol=1e-10).status == "solved"


RUBBED = {"cff_type": "STICTION", "mu_static": 0.5, "mu_dynamic": 0.4}


@pytest.mark.parametrize("fixed", [True, False])
def test_rigid_contacts_need_the_impulses_that_the_step_used(tmp_path, fixed):
    """A ball slides, a box rests: where the step's own impulses are determined they are these."""
    h = 1e-3
    model = GROUND + sphere(0.1, v=(1.0, 0, 0)) + cube(3, (1.0, 0.0, 0.5 * EDGE)) + GRAVITY
    model += contact(200, 100, 301, **RUBBED) + contact(300, 100, 302, **RUBBED)
    deck = write_deck(tmp_path, model + (FIXED.format(h=h) if fixed else ""), 0.01, h)
    # the step's own solver stops where a sweep changes less of a velocity than tol V
    results, problems, files = run(tmp_path, deck, integrator="MOREAU", tol=1e-10)
    assert files[0].name == "deck-i3-5.hdf5"
    for k, contents in enumerate(problems):
        problem, guess = contents.problem, contents.guesses[0]
        t, step = step_of(contents)
        assert problem.kind == "global"
        assert problem.mu == pytest.approx([0.4, 0.5, 0.5, 0.5, 0.5])
        found = solve(problem, tol=1e-12)
        assert found.status == "solved"
        np.testing.assert_allclose(found.r[:3], guess.r[:3], rtol=1e-9)
        np.testing.assert_allclose(found.u, guess.u, atol=1e-10)
        pressed = guess.r[3::3].sum()
        assert found.r[3::3].sum() == pytest.approx(pressed, rel=1e-7)
        assert pressed == pytest.approx(9.81 * step, rel=1e-7)
        if fixed:
            assert (t, step) == pytest.approx((3 * (k + 1) * h, h))
            force = results["contacts/301/force"][3 * (k + 1)]
            assert h * force[2] == pytest.approx(found.r[0], rel=1e-9)
            assert h * np.hypot(*force[:2]) == pytest.approx(np.hypot(*found.r[1:3]), rel=1e-9)
            assert np.hypot(*found.r[1:3]) == pytest.approx(0.4 * found.r[0], rel=1e-9)


def test_joints_are_in_the_matrix_of_rigid_contacts_too(tmp_path):
    h = 1e-3
    model = ROD + contact(200, 100, 301) + GRAVITY + FIXED.format(h=h)
    deck = write_deck(tmp_path, model, 0.02, h)
    results, problems, files = run(tmp_path, deck, integrator="MOREAU", every=4)
    at = [int(path.name.split("-i")[1].split("-")[0]) for path in files]
    for k, contents in zip(at, problems, strict=True):
        assert contents.problem.kind == "local"
        found = solve(contents.problem, tol=1e-12)
        assert found.status == "solved"
        assert found.r[0] == pytest.approx(h * results["contacts/301/force"][k, 2], rel=1e-9)
    last = problems[-1]
    W = last.problem.W.csr().toarray()
    # which of the tangential directions is the rod's is for the point to say
    assert W[0, 0] == pytest.approx(1.0 / 1.1, rel=1e-3)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(W[1:, 1:]), [0.0, 0.1**2 / 1.1], rtol=2e-3, atol=1e-12
    )
    assert last.guesses[0].r[0] == pytest.approx(9.81 * h, rel=2e-3)


def test_the_run_is_the_same_with_and_without(tmp_path):
    model = mbsim.read_model(MODELS / "stiction_incline.xml")
    with_it = mbsim.simulate(model, output=tmp_path / "a", dump_fclib=2)
    without = mbsim.simulate(model)
    np.testing.assert_array_equal(with_it["state/y"], without["state/y"])


def test_what_is_there_already_stays(tmp_path):
    deck = str(MODELS / "stiction_incline.xml")
    _, _, files = run(tmp_path, deck, every=40)
    kept = files[0].read_bytes()
    with pytest.raises(ResultsError, match="holds problems of an earlier run"):
        run(tmp_path, deck, every=40)
    assert files[0].read_bytes() == kept
    with pytest.raises(ModelError, match=r"Force_Contact\[\d+\]: dump_fclib does not go with"):
        run(tmp_path, MODELS / "stiction_rigid.xml")
    with pytest.raises(ModelError, match="dump_fclib needs an output folder"):
        mbsim.simulate(mbsim.read_model(deck), dump_fclib=1)
    said = CliRunner().invoke(main, ["run", deck, "--dump-fclib", "0"])
    assert said.exit_code == 2
    assert "--dump-fclib" in said.output


RIGID = MODELS / "rigid"


def wrong(problem, r):
    """Return how wrong impulses are, by the natural map over each contact's own size.

    That is the largest of |r_i - P(r_i - rho_i (u_i + mu_i |u_T| n))| over |r_i| or rho_i |q_i|,
    rho_i one over the largest eigenvalue of W_ii; u follows from r by the problem's matrices. Where
    both are 0, as between bodies that rest side by side, it is over the smallest of the others.
    """
    if problem.kind == "local":
        W, q = problem.W.csr().toarray(), problem.q
    else:
        M, H = problem.M.csr().toarray(), problem.H.csr().toarray()
        W, q = H.T @ np.linalg.solve(M, H), H.T @ np.linalg.solve(M, problem.f) + problem.w
    u, off, sizes = W @ r + q, [], []
    for i, mu in enumerate(problem.mu):
        at = slice(3 * i, 3 * i + 3)
        rho = 1.0 / np.linalg.eigvalsh(W[at, at])[-1]
        x = r[at] - rho * (u[at] + [mu * np.hypot(*u[at][1:]), 0.0, 0.0])
        across = np.hypot(*x[1:])
        if mu * across <= -x[0]:
            x = np.zeros(3)
        elif across > mu * x[0]:
            normal = (mu * across + x[0]) / (1.0 + mu * mu)
            x = np.array([normal, *(mu * normal / across * x[1:])])
        sizes.append(max(np.linalg.norm(r[at]), rho * np.linalg.norm(q[at])))
        off.append(np.linalg.norm(r[at] - x))
    sizes = np.array(sizes)
    sizes[sizes == 0.0] = sizes[sizes > 0.0].min()
    return float((np.array(off) / sizes).max())


@pytest.mark.parametrize(
    ("name", "end", "kind"),
    [
        ("balls_666", 0.2, "global"),
        ("boxes_in_bin", 0.6, "global"),
        ("cube_stack", 1.0, "global"),
        ("painleve_rod", 0.02, "global"),
        ("woodpecker", 0.05, "local"),
    ],
)
def test_the_hardest_problems_of_rigid_decks_are_a_set_that_is_solved(tmp_path, name, end, kind):
    results = mbsim.simulate(
        mbsim.read_model(RIGID / f"{name}.xml"), output=tmp_path, dump_hardest=3, end_time=end
    )
    files = sorted((tmp_path / "fclib").glob("*.hdf5"))
    assert 1 <= len(files) <= 3
    assert results.stats["steps"] > 3
    for file in files:
        problem = hdf5.read(file).problem
        assert problem.kind == kind
        found = solve(problem, tol=1e-10)
        assert found.status == "solved"
        assert wrong(problem, found.r) < 1e-8


def swept(contents):
    """Return how many sweeps a problem's step took."""
    return int(contents.problem.info.description.split("sweeps ")[1])


def test_the_hardest_are_those_of_all_that_took_most_sweeps(tmp_path):
    deck = RIGID / "boxes_in_bin.xml"
    _, every, _ = run(tmp_path / "all", deck, every=1, integrator="MOREAU", end_time=0.4)
    _, some, _ = run(
        tmp_path / "some", deck, every=1, integrator="MOREAU", end_time=0.4, dump_hardest=4
    )
    assert sorted(map(swept, some)) == sorted(map(swept, every))[-4:]


def test_a_resumed_run_keeps_the_same_hardest_problems(tmp_path):
    deck = mbsim.read_model(RIGID / "boxes_in_bin.xml")
    settings = {"dump_hardest": 4, "end_time": 0.6}
    mbsim.simulate(deck, output=tmp_path / "whole", **settings)

    def stop(t, h, end):
        if t > 0.3:
            raise KeyboardInterrupt

    with pytest.raises((Interrupted, KeyboardInterrupt)):
        mbsim.simulate(deck, output=tmp_path / "parts", progress=stop, **settings)
    mbsim.simulate(deck, output=tmp_path / "parts", resume=True, **settings)
    found = [
        {path.name: path.read_bytes() for path in (tmp_path / part / "fclib").glob("*.hdf5")}
        for part in ("whole", "parts")
    ]
    assert len(found[0]) == 4
    assert found[0].keys() == found[1].keys()


@pytest.mark.parametrize("tol", [1e-8, 1e-5, 1e-3])
def test_what_rests_is_written_a_few_times(tmp_path, tol):
    """Steps of a cube at rest: but for what tol leaves one problem."""
    model = GROUND + cube(2, (0.0, 0.0, 0.5 * EDGE)) + GRAVITY + contact(200, 100, 301, **RUBBED)
    deck = write_deck(tmp_path, model + FIXED.format(h=0.01), 5.0, 0.05)
    results, problems, _ = run(tmp_path, deck, every=1, integrator="MOREAU", tol=tol)
    assert results.stats["steps"] == 500
    assert len(problems) <= 25


def test_only_moreau_has_hardest_problems(tmp_path):
    deck = MODELS / "stiction_incline.xml"
    with pytest.raises(ModelError, match="dump_hardest is for integrator MOREAU"):
        run(tmp_path, deck, dump_hardest=3)


def test_a_folder_of_problems_is_solved_with_one_line_on_all(tmp_path):
    run(tmp_path, RIGID / "cube_stack.xml", integrator="MOREAU", end_time=1.0)
    said = CliRunner().invoke(main, ["fclib", "solve", str(tmp_path / "out" / "fclib")])
    assert said.exit_code == 0, said.output
    last = said.output.splitlines()[-1]
    assert " problems of 40 " in last
    assert " solved, in " in last

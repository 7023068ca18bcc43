"""Chains of hinged rods, planar and oblique.

python -m pytest -m bench -s tests/bench/test_chain.py
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers import joint_chain
from mbsim.bench import parameters as p
from mbsim.bench import report
from mbsim.bench.scenes.s01_top import rotations
from mbsim.bench.scenes.s08_linkages import chain_deck
from mbsim.core.problem import DONE
from mbsim.integrators import catalog, scheme
from mbsim.integrators.binding import advancing, bind

pytestmark = pytest.mark.bench

DECKS = {"planar": chain_deck, "oblique": joint_chain.chain_deck}
BOTH = pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853"])
RODS, TIMES = 40, np.linspace(0.0, 1.0, 101)
TIP_ERRORS = (1e-5, 1e-7)
TOLERANCES = 10.0 ** -np.arange(1.0, 8.01, 0.25)


def read(tmp_path, text):
    path = tmp_path / "chain.xml"
    path.write_text(text, encoding="utf-8")
    return mbsim.read_model(path)


def cost(stats):
    """Return nanoseconds of the compiled loop for each of its evaluations."""
    return 1e9 * stats["loop_s"] / (stats["rhs_evaluations"] + stats["output_evaluations"])


@pytest.mark.parametrize("kind", DECKS)
@BOTH
def test_cost_of_an_evaluation_of_a_chain(tmp_path, integrator, kind):
    few, many = report.CHAIN_BETWEEN
    costs = {}
    print()
    for rods in (2, few, 20, many, 80, 160):
        deck = read(tmp_path, DECKS[kind](rods, 2.0 if rods <= many else 0.2))
        runs = [mbsim.simulate(deck, integrator=integrator, tol=1e-8).stats for _ in range(4)]
        costs[rods] = min(cost(stats) for stats in runs[1:])
        print(
            f"{integrator}, {rods} {kind} rods: {costs[rods]:.0f} ns an evaluation, "
            f"{costs[rods] / rods:.0f} ns a rod, all included"
        )
    growth = costs[many] / costs[few]
    print(f"{integrator}: times {growth:.2f} from {few} to {many} rods (at most 5 asked)")
    assert np.isfinite(growth)


def free_end(results, rods):
    """Return the free end of the last rod (n, 3)."""
    last = f"bodies/{rods + 1}"
    along = rotations(results[f"{last}/quaternion"])[:, :, 0]
    return results[f"{last}/position"] + 0.5 * p.S8.length / rods * along


def of_poses(deck, integrator, tol):
    """Run mbsim, which integrates poses; return the free end and the evaluations taken."""
    results = mbsim.simulate(deck, integrator=integrator, tol=tol)
    return free_end(results, RODS), results.stats["rhs_evaluations"]


def of_joints(integrator, tol, tilt):
    """Run the same method and control on joint coordinates, to errors measured alike."""
    method = catalog.load(integrator)
    chain = joint_chain.make(RODS, len(TIMES) - 1, tilt)
    problem, _table = joint_chain.problem(chain)
    state = scheme.make(method, np.zeros(2 * RODS), 0.0)
    steps, _bench = bind(method, problem, state)
    advance = advancing()
    assert advance(steps, TIMES[-1], tol, math.inf, 0.0, TIMES[1:], 10**8) == DONE
    start = [p.S8.length, 0.0, 0.0]
    return np.vstack([start, chain.rows]), state.counts[scheme.EVALUATIONS]


def evaluations_at(error, points):
    """Return evaluations at a tip error, by a line through the points within a decade of it."""
    errors, counts = np.log10(points).T
    near = np.abs(errors - math.log10(error)) <= 1.0
    assert near.sum() >= 3, points
    line = np.polyfit(errors[near], counts[near], 1)
    return 10.0 ** np.polyval(line, math.log10(error))


@pytest.mark.parametrize("degrees", [0, 30])
@BOTH
def test_poses_need_as_few_evaluations_as_joint_coordinates(tmp_path, integrator, degrees):
    tilt = math.radians(degrees)
    exact = joint_chain.exact(RODS, TIMES, tilt)
    deck = read(tmp_path, joint_chain.chain_deck(RODS, TIMES[-1], tilt))
    points = {"poses": [], "joints": []}
    for tol in TOLERANCES:
        for form, (tip, count) in (
            ("poses", of_poses(deck, integrator, tol)),
            ("joints", of_joints(integrator, tol, tilt)),
        ):
            points[form].append((np.linalg.norm(tip - exact, axis=1).max(), count))
    print()
    for error in TIP_ERRORS:
        poses, joints = (evaluations_at(error, points[form]) for form in ("poses", "joints"))
        print(
            f"{integrator}, {RODS} oblique rods, hinges tilted by {degrees} degrees, tip error "
            f"{error:g} m: {poses:.0f} evaluations a simulated second with poses, "
            f"{joints:.0f} with joint coordinates, times {poses / joints:.2f} (at most 1.2 asked)"
        )
        assert poses <= 1.2 * joints


@BOTH
def test_energy_of_an_oblique_chain(tmp_path, integrator):
    rods = 10
    results = mbsim.simulate(
        read(tmp_path, joint_chain.chain_deck(rods, 10.0)), integrator=integrator
    )
    total = results["energy/kinetic"] + results["energy/potential"]
    drift = np.abs(total - total[0]).max() / (rods * p.S8.mass * p.GRAVITY * p.S8.length)
    print(
        f"\n{integrator}, {rods} oblique rods, 10 s, default tol: energy kept to {drift:.1e} m g L"
    )
    assert drift < 1e-4

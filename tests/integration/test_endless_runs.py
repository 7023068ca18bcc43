"""A run whose steps are so short that it would take days ends at once, and says who asks for them.

Nothing grows there and no step is refused: the motion that the deck asks for is that fast.
"""

from __future__ import annotations

import pytest

import mbsim
from mbsim.errors import SolverError
from mbsim.run.divergence import ENDLESS, FEW, ROWLESS, Pace

DECK = """<MotionSolve><Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.1" inertia_yy="0.2" inertia_zz="0.3" {}/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Force_Vector_OneBody id="5" type="FORCEONLY" marker_id="20" ref_marker_id="10"
  fx_expression="{}"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="2" print_interval="0.01"/>
</Command></MotionSolve>"""
BOUNDED = DECK.replace("<Simulate", '<Param_Transient h_max="1e-13"/><Simulate')
MOVING = 'v_ic_x="1" v_ic_x_flag="TRUE"'


@pytest.mark.parametrize(
    ("begin", "force", "who"),
    [
        ('w_ic_z="1e20" w_ic_z_flag="TRUE"', "0", r"Body_Rigid\[2\] has the speed"),
        (MOVING, "-DX(20, 10)/(TIME - TIME + 1e-25)", r"Force_Vector_OneBody\[5\] pushes most"),
        ("", "SIN(TIME/1e-15)", r"Force_Vector_OneBody\[5\] pushes most"),
    ],
    ids=["spin", "spring", "force of time"],
)
def test_a_run_that_would_take_days_ends_at_once(begin, force, who, tmp_path):
    with pytest.raises(SolverError, match=rf"no progress at time \d.*would take days; .*{who}"):
        mbsim.simulate(DECK.format(begin, force), output=tmp_path)
    (kept,) = tmp_path.glob("*.h5")
    with mbsim.open_results(kept) as results:
        assert results.stats["steps"] <= 3 * FEW
        assert len(results["time"]) == 1


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "AUTO"])
def test_steps_that_h_max_bounds_are_said_to_be_so(integrator):
    """The body that moves fastest was named, which asks for nothing."""
    with pytest.raises(SolverError, match="would take days; h_max=1e-13 allows no longer ones"):
        mbsim.simulate(BOUNDED.format(MOVING, "0"), integrator=integrator)


def pace_of(steps, end, interval):
    """Return a watch that has seen steps of these lengths, each 5000 times."""
    pace, t = Pace(0.0, end, interval), 0.0
    for k, step in enumerate(steps):
        pace.seen.append((5000 * k, t, 1.0))
        t += 5000 * step
    return pace, t


@pytest.mark.parametrize(
    ("steps", "end", "interval", "endless"),
    [
        ([1e-12] * 9, 1.0, 0.01, True),
        ([1e-12] * 8, 1.0, 0.01, False),  # not seen for long enough
        ([1e-12 * 2**k for k in range(9)], 1.0, 0.01, False),  # they grow
        ([1e-6] * 9, 1e9, 1e-3, False),  # an end that nobody waits for, with rows on the way
        ([1e-6] * 9, 1e4, 1e4, False),  # long, but it comes to an end
    ],
)
def test_what_grows_or_writes_rows_goes_on(steps, end, interval, endless):
    pace, t = pace_of(steps, end, interval)
    last = pace._pace(FEW)
    assert pace._is_endless(last, t) is endless
    if endless:
        assert (end - t) / last > ENDLESS
        assert interval / last > ROWLESS

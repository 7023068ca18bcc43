"""One step of nonsmooth time stepping: the file to read first.

    v_free = v + h M^-1 f                   forces as they are within the step (`implicit`)
    v' = v_free + sum of M^-1 H' r          contacts by impulses r (`solver`)
    q' = q moved on for h by (1 - c) v' + c v

c is 1/2 for bodies on which no contact closes in the step, so that flight and what slides or rests
are of order 2; 0 for those that a contact stops, which then end where gap + h u_n' >= 0 says:
at the surface; with restitution the part of the step before the impact (`displacements`).
Source: J. J. Moreau (1988); M. Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235; gaps in the
complementarity: M. Anitescu, F. A. Potra, Nonlinear Dynamics 14 (1997) 231; projection of
positions: V. Acary, Comput. Methods Appl. Mech. Eng. 256 (2013) 224.
"""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.bodies.awake import (
    bodies_awake,
    body_awake,
    graphic_awake,
    graphics_awake,
)
from mbsim.dynamics.bodies.kinematics import place_bodies, place_graphics, plane_travel
from mbsim.stepping.across import add_work_across, is_divided
from mbsim.stepping.arrays import (
    ALL_BODIES,
    ALL_POINTS,
    ALL_STEPS,
    ALL_SWEEPS,
    FIXED,
    HIT,
    LEFT_PART,
    MAY_BE_LEFT,
    NEWTONS,
    POINTS,
    PRESSING,
    PROJECTED,
    RESIDUAL,
    SLOP,
    SPEED,
    STEP_LENGTH,
    STIFFNESS,
    THETA,
    UNSOLVED,
    WOKEN,
    Stepping,
)
from mbsim.stepping.carried import carry_held, comes_from_afar, fill_flight, find_carried
from mbsim.stepping.displacements import (
    NO_IMPACT,
    fill_shift,
    move_bodies,
    spread_parts,
    velocities_jump,
)
from mbsim.stepping.driven import add_work_of_motions, presses_on_driven
from mbsim.stepping.energy import add_losses, keep_left, left_by_forces, left_by_spins
from mbsim.stepping.forces import find_forces_within, find_motion
from mbsim.stepping.free_motion import fill_motion, turn_to_global
from mbsim.stepping.friction import (
    begin_friction,
    keep_loads,
    left_near_yield,
    let_jam,
    let_stick,
    let_yield,
)
from mbsim.stepping.held import begin_answers
from mbsim.stepping.impacts import (
    HELD,
    is_held,
    let_carry,
    let_land,
    let_meet,
    let_share,
    look_ahead,
    postpone,
)
from mbsim.stepping.implicit import is_implicit, take_into_step
from mbsim.stepping.kept import index_kept, recall
from mbsim.stepping.missed import find_missed
from mbsim.stepping.near_pairs import FARTHER, list_anew
from mbsim.stepping.one_point import apply, fill_drift
from mbsim.stepping.pairs import find_points
from mbsim.stepping.points import fill_answers, fill_point, fill_reach, way_at
from mbsim.stepping.rebound import limit_rebound
from mbsim.stepping.scales import distance, group_at, left_at_rest, left_of, noise_of
from mbsim.stepping.sleep import find_still, is_still, wake_loaded
from mbsim.stepping.solver import move_farther, project_positions, solve_points

#: How often a step is solved at most, as what stuck slips.
MOST_YIELDS = 20
#: So often impacts of what a step throws at each other are put off with what they take solved anew.
MOST_POSTPONED = 5
#: How often a step is solved at most, as bodies turn out to be carried, or to hang above where they
#: land.
MOST_LANDINGS = 3
#: How often a step's contact problem is solved at most, each time with what bodies hit that the
#: impulses threw at it.
MOST_ATTEMPTS = 4
#: How often it is solved by its midst at most, where stiff forces turn as bodies do.
MOST_ROUNDS = 6


@jitable
def reach_of(scene: Scene, S: Stepping, g: int, h: float) -> float:
    """Return how far a graphic may come in a step; a plane at the distance of a usual member."""
    reach = S.motion.reach[g]
    if math.isinf(reach):
        # a plane that turns, see `plane_travel`
        reach = way_at(scene, S, g, h, scene.broadphase.lever[g])
    return reach


@jitable
def make_room(scene: Scene, S: Stepping, y: F1, h: float) -> None:
    """List near pairs farther than a step can come, where shapes got fast."""
    broadphase = scene.broadphase
    if len(broadphase.contact) == 0:
        return
    fill_reach(scene, S, h)
    short = False
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        if not math.isinf(broadphase.room[g]):
            short = short or reach_of(scene, S, g, h) > broadphase.room[g]
    if short:
        for k in range(graphics_awake(scene)):
            g = graphic_awake(scene, k)
            if not math.isinf(broadphase.room[g]):
                # what a try found out holds until the step is taken
                farther = FARTHER * reach_of(scene, S, g, h)
                broadphase.own[g] = max(farther, broadphase.own[g])
        place_graphics(scene, y)
        list_anew(scene, S, y)


@jitable
def want_room(scene: Scene) -> None:
    """Have near pairs listed anew before the next try of a step, as far as shapes went in this."""
    broadphase = scene.broadphase
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        if not math.isinf(broadphase.room[g]):
            broadphase.room[g] = 0.0
            travel = scene.work.travel[g]
            if math.isinf(travel):
                travel = plane_travel(scene, g)
            broadphase.own[g] = max(FARTHER * travel, broadphase.own[g])


@jitable
def prepare_points(scene: Scene, S: Stepping, h: float) -> int:
    """Fill all that the solver takes, impulses as the last step had them, and velocities so.

    Return 0 or a code.
    """
    P, M = S.points, S.motion
    count, begin = S.tally.count[POINTS], 0
    begin_answers(S)
    recall(S, h)
    for k in range(count):
        if not fill_point(scene, S, k, begin, h):
            return Code.MANY_POINTS
        begin += P.many[k] if P.wide[k] >= 0 else 0
    fill_answers(scene, S)
    M.still[0] = 0
    if count > 0:
        find_still(scene, S, h)
    for k in range(count):
        g = group_at(S, k)
        P.speed[k], P.least[k] = S.plan.scale[g, SPEED], left_of(S, g, h)
        if is_still(S, k):
            P.least[k] = left_at_rest(S, g, h)
            M.still[0] += 1
    begin_friction(S, count, h)
    return 0


@jitable
def look_at(S: Stepping, k: int, h: float) -> None:
    """Fill what impulses have to bring about at point k, by what its bodies do until they meet."""
    P = S.points
    look_ahead(S, k, h)
    P.held[k] = HELD if P.part[k] != NO_IMPACT and is_held(S, k, h) else 0
    if P.held[k] == HELD:
        P.ahead[k], P.part[k] = max(P.gap[k], 0.0) / h, NO_IMPACT


@jitable
def look_at_points(scene: Scene, S: Stepping, h: float) -> None:
    """Fill what impulses have to bring about, and how bodies fly if others hold what is hit."""
    P, M, hit = S.points, S.motion, False
    fill_flight(scene, S)
    for k in range(S.tally.count[POINTS]):
        look_at(S, k, h)
        hit = hit or (P.part[k] != NO_IMPACT and comes_from_afar(S, k, h))
        fill_drift(P, k, M.before, M.free)
    if hit and carry_held(scene, S, h):
        for k in range(S.tally.count[POINTS]):
            if comes_from_afar(S, k, h):
                look_at(S, k, h)


@jitable
def start_impulses(scene: Scene, S: Stepping, h: float) -> None:
    """Fill what impulses have to bring about, and velocities with them as they stand."""
    P, M, ground = S.points, S.motion, len(S.rest.body)
    for c in range(6):
        M.v[ground, c] = M.free[ground, c]
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        for c in range(6):
            M.v[b, c] = M.free[b, c]
        M.changed[b] = 0
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] > 0.0:
            r = (P.r[k, 0], P.r[k, 1], P.r[k, 2])
            apply(P, k, M.v, r)
        if P.was[k] < 0 and P.gap[k] <= S.plan.scale[group_at(S, k), SLOP]:
            # what holds there is not known yet
            M.changed[P.body[k, 0]] = M.changed[P.body[k, 1]] = 1
    M.changed[ground] = 0
    look_at_points(scene, S, h)


@jitable
def solve_law(S: Stepping, count: int, ground: int, h: float) -> tuple[float, float, int, bool]:
    """Find impulses, of what sticks and slips as well.

    Return what a sweep still changes, over what may be left, what part of that was asked for,
    sweeps, and if it is solved.
    """
    P, M, tally = S.points, S.motion, S.tally
    left, sweeps, solved, tried = 0.0, 0, True, 0
    sharp, part = 1.0, S.plan.number[LEFT_PART]
    for attempt in range(MOST_YIELDS + 1 if count > 0 else 0):
        left, more, newtons, solved = solve_points(P, M, ground, count, (sharp, part))
        sweeps += more
        tally.count[NEWTONS] += newtons
        if not math.isfinite(left):
            break
        if attempt == MOST_YIELDS:
            # what yields or meets by now does so in the next step: impulses are those of the law
            # as it was when they were solved
            break
        if not solved and let_jam(S, count, h, sharp):
            continue
        near = left_near_yield(S, count)
        if near < 0.5 * sharp:
            # not for what is less by rounding alone: tries are few
            sharp = near
            continue
        tried = attempt
        changed = let_meet(S, count, h)
        if attempt < MOST_POSTPONED and postpone(S, count, h):
            # velocities are no solution now that friction could be judged by
            continue
        # what begins to stick is not asked yet whether it holds: velocities are those of its slip
        changed = let_yield(S, count, h) or changed
        changed = let_stick(S, count, h) or changed
        if not changed:
            break
    if tried >= MOST_POSTPONED:
        # what these threw at each other flies on: pressed together it would be given energy
        postpone(S, count, h)
    return left, sharp, sweeps, solved


@jitable
def solve_step(scene: Scene, S: Stepping, h: float, committed: bool) -> int:
    """Find impulses and displacements of the points at hand; return 0 or a code."""
    P, M, tally = S.points, S.motion, S.tally
    count, nb = tally.count[POINTS], len(scene.bodies.mass)
    start_impulses(scene, S, h)
    # `sharp`: part of what the solver may leave; `most`: the largest of that
    sharp, part, most = 1.0, S.plan.number[LEFT_PART], 0.0
    left, sweeps, solved = 0.0, 0, True
    for k in range(count):
        P.mu[k] = P.holds[k]
        most = max(most, P.least[k])
    for landing in range(MOST_LANDINGS):
        left, sharp, more, solved = solve_law(S, count, nb, h)
        if not math.isfinite(left):
            return Code.NOT_FINITE
        sweeps += more
        more_left, more, newtons = limit_rebound(scene, S, count, h, (sharp, part))
        if not math.isfinite(more_left):
            return Code.NOT_FINITE
        left = max(left, more_left)
        sweeps += more
        tally.count[NEWTONS] += newtons
        spread_parts(scene, S, count, h)
        fill_shift(scene, S)
        if landing == MOST_LANDINGS - 1:
            break
        changed = let_carry(S, count, h)
        changed = let_share(S, count) or changed
        if not let_land(S, count, h) and not changed:
            break
    if len(S.plan.members) > 0:
        # of bodies that joints hold, or forces couple, to those that have points
        move_farther(P, M, count)
        fill_shift(scene, S)
    pushes = project_positions(P, M.shift, count, h)
    number = tally.number
    # of two halves that make one step the worse one counts
    left *= sharp * most
    may = number[MAY_BE_LEFT]
    if committed or may == 0.0 or left * may > number[RESIDUAL] * most:
        number[RESIDUAL], number[MAY_BE_LEFT] = left, most
    number[STEP_LENGTH] = h
    hit = 1.0 if velocities_jump(scene, S) else 0.0
    number[HIT] = hit if committed else max(hit, number[HIT])
    tally.count[ALL_SWEEPS] += sweeps
    tally.count[ALL_STEPS] += 1
    tally.count[ALL_POINTS] += count
    tally.count[UNSOLVED] += 0 if solved else 1
    tally.count[PROJECTED] += 1 if pushes > 1 else 0
    pressing = 0
    for k in range(count):
        pressing += 1 if P.r[k, 0] > 0.0 else 0
    tally.count[PRESSING] = pressing
    return 0


@jitable
def solve_by_middle(scene: Scene, S: Stepping, t: float, h: float, y: F1, committed: bool) -> int:
    """Solve the step with forces and accelerations as they are within it; return 0 or a code.

    That is in its midst, if forces are not stiff. Where that is follows from the step as it was
    found so far: what rests then stays there.
    """
    M, middle, dy, theta = S.motion, S.motion.middle, S.motion.slope, S.forces.number[THETA]
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(y)):
        middle[k] = y[k] + theta * h * dy[k]
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        for c in range(6):
            change = M.v[b, c] - M.before[b, c]
            M.shift[b, c] += (theta - 0.5) * change
            # the displacement is that of `shift` alone
            M.v[b, c] = M.before[b, c] + theta * change
    move_bodies(scene, S, y, theta * h, middle)
    code = find_forces_within(scene, S, t, h, y)
    wake_loaded(scene, S)
    if code != 0 or S.rest.count[WOKEN] == 1:
        return code
    turn_to_global(scene, dy)
    place_bodies(scene, y)
    fill_motion(scene, S, y, middle, h)
    if is_implicit(S):
        code = take_into_step(scene, S, h, dy, False)
        if code != 0:
            return code
    return solve_step(scene, S, h, committed)


@jitable
def has_settled(scene: Scene, S: Stepping, h: float) -> bool:
    """Return whether velocities are those by which the forces of the step were found.

    A damper of rate s/h takes s times the energy of what they are off by.
    """
    if not is_implicit(S):
        return True
    M, root = S.motion, math.sqrt(h * S.forces.number[STIFFNESS] + 1e-300)
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        if distance(S, b, M.v, M.guess) > noise_of(S, S.plan.connected[b], h) / root:
            return False
    return True


@jitable
def solve_until_settled(
    scene: Scene, S: Stepping, t: float, h: float, y: F1, committed: bool
) -> int:
    """Solve the step by its midst, again where stiff forces turn within it; return 0 or a code.

    What Newton's method leaves of a velocity, times the damper across it, is a force that the
    energy does not have.
    """
    M, code = S.motion, 0
    for _ in range(MOST_ROUNDS):
        for k in range(bodies_awake(scene)):
            b = body_awake(scene, k)
            for c in range(6):
                M.guess[b, c] = M.v[b, c]
        code = solve_by_middle(scene, S, t, h, y, committed)
        if code != 0 or S.rest.count[WOKEN] == 1:
            return code
        if has_settled(scene, S, h):
            break
    return code


@jitable
def solve_all(scene: Scene, S: Stepping, t: float, h: float, y: F1, committed: bool) -> int:
    """Solve the step with all points that its motion reaches; return 0 or a code."""
    for attempt in range(MOST_ATTEMPTS):
        code = prepare_points(scene, S, h)
        if code == 0:
            code = solve_step(scene, S, h, committed)
        if code != 0:
            return code
        missed = 0
        if S.tally.count[PRESSING] > 0 and attempt < MOST_ATTEMPTS - 1:
            missed = find_missed(scene, S, y, h)
        if missed < 0:
            return -missed
        if S.rest.count[WOKEN] == 1:
            return 0
        if missed == 0:
            break
    if scene.world.hooks[Hook.APPLIED] != 0 or scene.world.hooks[Hook.JOINTS] != 0:
        return solve_until_settled(scene, S, t, h, y, committed)
    return 0


@jitable
def move_on(scene: Scene, S: Stepping, t: float, h: float, y: F1, new: F1, committed: bool) -> int:
    """Fill the state a step h after (t, y) that has been solved, and what was lost in it.

    Return 0 or a code.
    """
    presses, code = S.tally.count[PRESSING] > 0, 0
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(y)):
        new[k] = y[k] + h * S.motion.slope[k]
    left = left_by_forces(scene, S, h)
    if presses:
        if is_divided(scene, S):
            code = add_work_across(scene, S, t, h, new)
            place_bodies(scene, y)
        add_losses(scene, S, new)
    move_bodies(scene, S, y, h, new)
    keep_left(S, left + left_by_spins(scene, S, new), committed)
    if presses and code == 0:
        if presses_on_driven(scene, S):
            code = add_work_of_motions(scene, S, t, h, new)
        # impulses may throw bodies farther than was looked for
        if not place_graphics(scene, new):
            code = Code.TOO_FAR
    return code


@jitable
def take_step(
    scene: Scene, S: Stepping, t: float, h: float, y: F1, new: F1, committed: bool
) -> int:
    """Fill the state a step h after (t, y); return 0 or a code."""
    if committed:
        for c in range(len(S.tally.deepest)):
            S.tally.deepest[c] = 0.0
    S.rest.count[WOKEN] = 1
    while S.rest.count[WOKEN] == 1:
        # once more where something wakes: with all that is awake then
        S.rest.count[WOKEN] = 0
        S.tally.count[ALL_BODIES] += bodies_awake(scene)
        code = find_motion(scene, S, t, h, y)
        if code != 0:
            return code
        if S.rest.count[WOKEN] == 1:
            continue
        if committed:
            index_kept(S)
            make_room(scene, S, y, h)
        find_carried(scene, S, h)
        code = find_points(scene, S, y, h, committed)
        if code == 0 and S.rest.count[WOKEN] == 0:
            code = solve_all(scene, S, t, h, y, committed)
        if code != 0:
            return code
    if S.plan.number[FIXED] == 0.0:
        keep_loads(S, S.tally.count[POINTS], committed)
    return move_on(scene, S, t, h, y, new, committed)

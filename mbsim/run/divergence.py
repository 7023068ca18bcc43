"""When a run makes no progress: a motion that runs off to a pole is told, not followed for hours.

A watch looks every `core.problem.WATCH_EVERY` steps, and gives up where one of these holds:

* the last STALLED steps were on average shorter than a SLIVER of the time that has passed;
* at the pace of the last FEW steps HOPELESS more are to come, while the fastest body is FAST times
  the model's own speed V and GROWTH times as fast as when a hundredth of the time was left out;
* at the pace of the last FEW steps, and at that of the FEW before, ENDLESS more are to come, and
  ROWLESS before the next row: a day without a row at a step a microsecond. The motion itself is so
  fast: a spin, a swing on a spring, a force that changes with time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsim.arrays.codes import (
    APPLIED_FORCE,
    APPLIED_TORQUE,
    SCALE_LENGTH,
    SCALE_SPEED,
    STORED_ENERGY,
    WHOLE,
    WORST_BODY,
)
from mbsim.errors import SolverError
from mbsim.model.names import element_name

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

STALLED, SLIVER = 200_000, 1e-9
FEW, HOPELESS, FAST, GROWTH = 20_000, 1e7, 1e6, 100.0
ENDLESS, ROWLESS = 1e11, 1e9
#: Steps are the same where their mean is this many times that of them and as many before, at most.
STEADY = 1.2
#: Steps whose mean is more than this part of `h_max` are bounded by that: others end at rows.
AS_LONG = 0.5
#: Part of the time that has passed over which speeds are compared.
LATELY = 0.01
_NAMES = ("displacement", "velocity", "acceleration")


#: Compiled code comes back for progress and Ctrl-C about this often [s]; it counts evaluations,
#: which cost from 0.2 us to whatever a user's function takes, so the count is adapted.
RETURN_SECONDS = 0.1


def next_budget(budget: int, done: int, elapsed: float) -> int:
    """Return for how many evaluations to call next, after one that did so many in `elapsed` [s].

    At most four times as many as before: the first calls also compile or load code. One that came
    back for something else before it did any says nothing.
    """
    if not done:
        return budget
    wanted = RETURN_SECONDS * done / max(elapsed, 1e-9)
    return int(min(max(wanted, 1.0), 4.0 * budget))


class Pace:
    """Steps, time and speed of one Simulate, as far back as they are asked for."""

    def __init__(self, start: float, end: float, interval: float) -> None:
        self.start, self.end, self.interval = start, end, interval  # of rows
        self.seen: deque[tuple[int, float, float]] = deque()

    def saved(self) -> dict[str, Any]:
        """Return what a resumed run needs: it gives up where the straight one does."""
        return {"pace/seen": np.array(self.seen, dtype=np.float64).reshape(-1, 3)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go back to a checkpoint of the same Simulate."""
        self.seen = deque((int(n), float(t), float(v)) for n, t, v in saved["pace/seen"])

    def watch(self, system: System, y: Any, t: float, steps: int, h_max: float) -> None:
        """Note where the run is at time t; raise SolverError where it gets nowhere.

        `h_max` is the longest step that the deck, or a sensor, allows.
        """
        speed = _fastest(system, y)
        self.seen.append((steps, t, speed))
        passed = t - self.start
        # two of them before the span that counts, so that the deque stays short
        while len(self.seen) > 2 and self._is_old(self.seen[1], steps, t):
            self.seen.popleft()
        pace = self._pace(FEW)
        if pace is not None and (self.end - t) / max(pace, 1e-300) > HOPELESS:
            long_ago = t - LATELY * passed
            before = next((v for _, when, v in reversed(self.seen) if when <= long_ago), 0.0)
            if speed > max(FAST * system.scene.world.scale[SCALE_SPEED], GROWTH * before):
                _give_up(system, y, t, pace, "the motion leaves all bounds", "")
        if pace is not None and self._is_endless(pace, t):
            where = _bounded(pace, h_max) or _hurried(system, y, t)
            _give_up(system, y, t, pace, "the run would take days", where)
        pace = self._pace(STALLED)
        if pace is not None and pace < SLIVER * passed:
            where = _bounded(pace, h_max) or _pressed(system)
            _give_up(system, y, t, pace, "the run would not end", where)

    def _is_endless(self, pace: float, t: float) -> bool:
        """Return whether so many steps are to come that it is no matter of waiting.

        Steps that grow say nothing yet: what dies out may begin with short ones.
        """
        both = self._pace(2 * FEW)
        if both is None or pace > STEADY * both:
            return False
        step = max(pace, both, 1e-300)
        return (self.end - t) / step > ENDLESS and self.interval / step > ROWLESS

    def _is_old(self, seen: tuple[int, float, float], steps: int, t: float) -> bool:
        return seen[0] <= steps - STALLED and seen[1] <= t - LATELY * (t - self.start)

    def _pace(self, count: int) -> float | None:
        """Return the average of at least `count` last steps, None where there are fewer."""
        last, t, _ = self.seen[-1]
        for steps, when, _ in reversed(self.seen):
            if last - steps >= count:
                return (t - when) / (last - steps)
        return None


def _speeds(system: System, y: Any) -> Any:
    """Return the speed of each body: of its cg, or of a point L away as it turns."""
    from mbsim.core.layout import AT_V, AT_W, BODY_SIZE

    nb = len(system.body_ids)
    rows = y[: BODY_SIZE * nb].reshape(nb, BODY_SIZE)
    turning = np.linalg.norm(rows[:, AT_W:], axis=1) * system.scene.world.scale[SCALE_LENGTH]
    return np.maximum(np.linalg.norm(rows[:, AT_V:AT_W], axis=1), turning)


def _fastest(system: System, y: Any) -> float:
    return float(_speeds(system, y).max(initial=0.0))


def _give_up(system: System, y: Any, t: float, pace: float, why: str, where: str) -> NoReturn:
    raise SolverError(
        f"no progress at time {t:.9g}: steps are {pace:.3g} on average and {why}; "
        f"{where or _culprit(system, y, t)}. Results up to there are kept."
    )


def _bounded(pace: float, h_max: float) -> str:
    """Return what is to be said of steps that are as long as they may be, "" for others."""
    return f"h_max={h_max:g} allows no longer ones" if pace > AS_LONG * h_max else ""


def _pressed(system: System) -> str:
    """Return the body whose error bounds the steps and the contact that acts on it, "" for none."""
    from mbsim.dynamics.pipeline.output import find_fault

    contact, body = find_fault(system.scene), int(system.scene.work.diagnostics[WORST_BODY])
    if contact < 0 or not 0 <= body < len(system.body_ids):
        return ""
    by = f"Force_Contact[{system.contact_ids[contact]}]"
    return f"{system.body_name(body)} asks for them, on which {by} acts"


def _hurried(system: System, y: Any, t: float) -> str:
    """Return who asks for steps that are too many: a contact, or what moves and pushes most."""
    from mbsim.results.elements import GROUPS

    pressed = _pressed(system)
    if pressed:
        return pressed
    table = np.abs(system.scene.work.applied)
    sizes = table[:, APPLIED_FORCE:APPLIED_TORQUE].max(axis=1, initial=0.0)
    torques = table[:, APPLIED_TORQUE:STORED_ENERGY].max(axis=1, initial=0.0)
    sizes = np.maximum(sizes, torques / system.scene.world.scale[SCALE_LENGTH])
    said = _culprit(system, y, t)
    if not len(sizes) or not sizes.max() > 0.0:
        return said
    statement, id = system.applied[int(sizes.argmax())]
    name = element_name(system.model.file, GROUPS[statement].title, id)
    return f"{said}, and {name} pushes most, with {sizes.max():.3g}"


def _culprit(system: System, y: Any, t: float) -> str:
    """Return the motion that asks for most, or else the fastest body, and what it does."""
    from mbsim.dynamics.expressions.jets import jet
    from mbsim.dynamics.initial.assembly import equation_name

    scene, found = system.scene, []
    for e in np.flatnonzero((scene.equations.program >= 0) & (scene.equations.general != WHOLE)):
        level = int(scene.equations.level[e])
        try:
            jets = jet(scene, t, y, int(scene.equations.program[e]))[: 1 + level]
        except ArithmeticError:
            continue
        names = _NAMES[2 - level :]
        said = ", ".join(f"{name} {float(u):.3g}" for name, u in zip(names, jets, strict=True))
        # its highest rate grows most
        size = abs(float(jets[-1])) / scene.equations.unit[e]
        found.append((size, f"{equation_name(system, int(e))} asks for {said}"))
    speeds = _speeds(system, y)
    if found and max(found)[0] * scene.world.scale[SCALE_LENGTH] > speeds.max():
        return max(found)[1]
    body = int(speeds.argmax())
    return f"{system.body_name(body)} has the speed {speeds[body]:.3g}"

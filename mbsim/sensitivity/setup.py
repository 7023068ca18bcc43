"""`Sensitivities`: made for a run, its rows taken beside the run's, and what came of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.hooks import Hook
from mbsim.core import jit, tags
from mbsim.core.address import pack
from mbsim.core.problem import HOOK
from mbsim.dynamics.bodies import configuration
from mbsim.integrators import scheme
from mbsim.results.blocks import Block, Gathered
from mbsim.results.signal_filter import SignalFilter
from mbsim.results.signals import signals
from mbsim.sensitivity import arrays as at
from mbsim.sensitivity.along import WORK
from mbsim.sensitivity.arrays import Variations
from mbsim.sensitivity.hooks import AT, commit_hook, output_hook, rhs_hook
from mbsim.sensitivity.implicit import STAGES
from mbsim.sensitivity.parameters import SURFACE, Direction, replaced, weighed
from mbsim.sensitivity.reintegration import MOTIONS
from mbsim.sensitivity.sizes import breaks, enough, one_sided, scale, steps
from mbsim.sensitivity.timed import SIDES

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.core.problem import Problem

Array = np.ndarray[Any, Any]
#: State that counts and judges: the twin's own, so that it leaves the run's alone.
_OWN_STATE = (
    "log/", "audit/", "rows/", "state/memory", "state/before", "state/chattering",
    "work/friction_slope",
)  # fmt: skip
#: What a derivative is off by in the end, over what the error of a step of it may be in usual
#: sizes; what part of its largest value that may be, or a run says so of what changes the motion by
#: less than so much of usual sizes.
UNSEEN, KNOWN_TO, LITTLE = 10.0, 1e-4, 1e-2
#: What is one whole number of each parameter.
_FLAGS = ("stale", "bend_known", "ready", "bends", "bent", "close", "fifth", "told")
#: What is no signal of the motion.
_NO_SIGNALS = ("time", "state/", "contact_points/", "events")
_WHY = {
    at.LOST_FAILED: "the equations beside the run could not be evaluated or solved",
    at.LOST_JUMP: "forces jump, or what friction keeps; how the time of that moves is unknown",
    at.LOST_GRAZING: "an event is met with next to no speed: its time has no derivative",
    at.LOST_LARGE: "it has grown beyond all bounds: the motion is chaotic",
    at.LOST_USER: "a user's subroutine jumps, at a time that it keeps to itself and this moves",
    at.LOST_WORK: "it takes far more evaluations than the run itself",
}


def twin_of(system: System, directions: Sequence[Direction]) -> System:
    """Return a system of the run's arrays, with constants that change and scratch of its own."""
    scene, own = system.scene, {}
    changed = {name for direction in directions for name in direction.arrays}
    for name, array in tags.arrays(scene, tags.CONSTANT):
        if name in changed:
            own[name] = array.copy()
    for name, array in tags.arrays(scene, tags.SCRATCH):
        own[name] = array.copy()
    for name, array in tags.arrays(scene, tags.STATE):
        if name.startswith(_OWN_STATE):
            own[name] = array.copy()
    if "graphics/surfaces" in own:
        # shapes say where their triangles are
        size = scene.graphics.size.copy()
        off = own["graphics/surfaces"].ctypes.data - scene.graphics.surfaces.ctypes.data
        size[:, SURFACE] += np.where(size[:, SURFACE] != 0.0, float(off), 0.0)
        own["graphics/size"] = size
    # which linearisation it has is its own
    own["world/hooks"] = scene.world.hooks.copy()
    rows = 2 * len(directions)
    for name, array in tags.arrays(scene.rows, tags.SCRATCH, "rows/"):
        own[name] = np.zeros((rows * len(array), *array.shape[1:]), array.dtype)
    return dataclasses.replace(system, scene=replaced(scene, own))


class Sensitivities:
    """Derivatives of a run with respect to parameters.

    Parameters
    ----------
    system : System
        Of the run, as it stands at its start.
    directions : sequence of Direction
    assemble : callable
        Puts the bodies of a point of a system where constraints hold: the twin's, then the point.
    tol : float
        Of the run.
    worth : int
        A derivative ends where it has taken so many times the run's own evaluations, 0: nowhere.
    start : float
        Time at which the run begins.
    """

    def __init__(
        self,
        system: System,
        directions: Sequence[Direction],
        y: Array,
        assemble: Callable[[System, System, Any, Array], None],
        problem: Problem,
        tol: float,
        worth: int = 0,
        start: float = 0.0,
    ) -> None:
        from mbsim.compile_model.timetable import follows_time

        self.system, self.directions, self._tol = system, list(directions), tol
        self.twin = twin_of(system, directions)
        self._table = pack(self.twin.scene)
        self.gathered = Gathered(self.twin)
        self._steps: list[Array] = []
        own = problem._replace(context=int(self._table.ctypes.data))
        starts = [self._start(direction, assemble, own) for direction in self.directions]
        self.arrays = self._arrays(y, np.array(starts), tol)
        self.arrays.words[at.WORTH] = worth
        self._users = _users(system)
        jumps = bool(np.any(system.scene.switching.jumps == 1))
        self.arrays.words[at.HIDES] = at.LOST_USER if self._users else at.LOST_JUMP if jumps else 0
        self.arrays.words[at.TIMED] = int(follows_time(system.scene))
        self.arrays.gap[at.LAST], self.arrays.gap[at.UNTIL] = -math.inf, start
        self._pack()
        self._alive: Any = None
        self._mark: Any = None

    def _start(self, direction: Direction, assemble: Any, problem: Problem) -> Array:
        """Return the derivative of y at the start."""
        scene, found = self.twin.scene, []
        state = tags.copies(scene, tags.STATE)
        own = {name: tags.at_path(scene, name).copy() for name in direction.arrays}
        for system in direction.systems:
            for name, slope in direction.arrays.items():
                np.copyto(
                    tags.at_path(scene, name), tags.at_path(system.scene, name), where=slope != 0.0
                )
            y = system.y0.copy()
            assemble(self.twin, system, problem, y)
            found.append(y)
        for name, array in own.items():
            tags.at_path(scene, name)[...] = array
        tags.put_back(scene, tags.STATE, state)
        return weighed(found, direction.change)

    def _arrays(self, y: Array, start: Array, tol: float) -> Variations:
        """Return what is kept from step to step."""
        scene, n, count = self.system.scene, len(y), len(self.directions)
        shape = scene.state.memory.shape
        place, base, slope, first = [], [], [], [0]
        for direction in self.directions:
            for name, table in direction.arrays.items():
                own = tags.at_path(self.twin.scene, name)
                for k in np.flatnonzero(table):
                    place.append(own.ctypes.data + 8 * int(k))
                    base.append(float(own.ravel()[k]))
                    slope.append(float(table.ravel()[k]))
            first.append(len(place))
        held = at.HELD if shape[1] else 0
        return Variations(
            words=np.zeros(at.WORDS, dtype=np.int64),
            d=start.reshape(count, n).copy(),
            memory=np.zeros((count, *shape)),
            before=np.zeros((count, *shape)),
            lost=np.full(count, math.inf),
            why=np.zeros(count, dtype=np.int64),
            dense=np.zeros((count, 0, n)),
            later=np.zeros((count, 2)),
            next=np.zeros((count, n)),
            far=np.zeros((3, *shape)),
            plain=np.zeros((3, n)),
            stage=np.zeros((STAGES, n)),
            path=np.zeros((0, n)),
            work=np.zeros((WORK, n)),
            error=np.zeros(count),
            enough=enough(self.system, tol),
            carried=np.zeros((count, 4, n)),
            bend=np.zeros((count, n)),
            jump=np.zeros((5, n)),
            end=np.zeros((count, *shape)),
            middle=np.zeros((count, *shape)),
            mode=np.zeros(shape[0]),
            reach=np.zeros(count),
            depth=np.zeros((3, shape[0])),
            odd=np.zeros((2, shape[0]), dtype=np.int64),
            line=np.zeros(9),
            shift=np.zeros((count, shape[0] + 1)),
            times=np.zeros((count, shape[0] + 1, 3)),
            asks=np.zeros(shape[0] + 1, dtype=np.int64),
            reason=np.zeros(count),
            breaks=breaks(self.system),
            seen=np.zeros(len(scene.state.touching) + 1, dtype=np.int64),
            own=np.zeros(n),
            kept=np.zeros((count, n)),
            part=np.zeros((count * at.MOST_PARTS, 5, n)),
            about=np.zeros((count * at.MOST_PARTS, 6)),
            parts=np.zeros(count, dtype=np.int64),
            wide=np.zeros(count),
            lasted=np.zeros(count),
            change=np.zeros((at.MOST_CHANGES, 4)),
            row=np.zeros((4, n)),
            one_sided=one_sided(self.system),
            scale=scale(self.system, n),
            felt=scale(self.system, n),
            jumping=scale(self.system, n, jumping=True),
            room=scale(self.system, n) * steps(self.system, n),
            weights=np.zeros(0),
            estimates=np.zeros((1, 0)),
            held=np.concatenate(([0, 0], np.arange(held))),
            held_time=np.zeros(held),
            held_y=np.zeros((held, n)),
            held_d=np.zeros((held, count, n)),
            held_memory=np.zeros((held, *shape)),
            held_moves=np.zeros((held * count, *shape)),
            again=np.zeros((MOTIONS, 6, n)),
            slopes=np.zeros((7, n)),
            slope=np.zeros((count, n)),
            smooth=np.zeros(count, dtype=np.int64),
            size=np.array([direction.size for direction in self.directions]),
            first=np.array(first, dtype=np.int64),
            place=np.array(place, dtype=np.int64),
            base=np.array(base),
            rise=np.array(slope),
            **_of_jumps(count, n),
            step=np.zeros((len(scene.rows.time), count)),
        )

    def hooked(self, problem: Problem) -> Problem:
        """Return the run's problem with the hooks that carry derivatives along."""
        words = self.arrays.words
        commit, output = (jit.address(f, HOOK) for f in (commit_hook, output_hook))
        if problem.commit != commit:
            words[at.COMMIT], words[at.OUTPUT] = problem.commit, problem.output
        return problem._replace(commit=commit, output=output)

    def bind(self, running: scheme.Scheme, problem: Problem, workspace: Any) -> None:
        """Go on with the method that runs; `workspace` is the table of its own."""
        from mbsim.compile_model.program_dependence import find_depends
        from mbsim.compile_model.tangent import make_tangent
        from mbsim.integrators import galpha

        words, n = self.arrays.words, self.arrays.d.shape[1]
        own = problem._replace(
            context=int(self._table.ctypes.data),
            commit=int(words[at.COMMIT]),
            output=int(words[at.OUTPUT]),
        )
        words[at.RHS] = problem.rhs
        own = own._replace(rhs=jit.address(rhs_hook, HOOK))
        kept: list[Any] = []
        kinds = configuration.kinds(len(self.system.body_ids), n)
        for word in (at.UP, at.DOWN):
            method = scheme.make(running, np.zeros(n), 0.0, kinds)
            method.memory[scheme.TOL] = 1e300
            space = scheme.Workspace(np.array(own, dtype=np.int64), method)
            table = pack(space)
            words[word] = int(table.ctypes.data)
            kept.append((space, table))
        hooks = self.twin.scene.world.hooks
        hooks[...] = self.system.scene.world.hooks
        words[at.RUN_TANGENT] = hooks[Hook.TANGENT]
        if running.implicit:
            made = make_tangent(
                self.twin.scene, find_depends(self.twin.scene), problem.solve_pair != 0
            )
            table = pack(made)
            kept.append((made, table))
            words[at.OWN_TANGENT] = int(table.ctypes.data)
        words[at.METHOD] = int(workspace.ctypes.data)
        words[at.TWIN] = int(self._table.ctypes.data)
        words[at.ATTEMPT] = 0 if running.implicit else jit.address(running.attempt, HOOK)
        words[at.FIT_DENSE] = 0 if running.implicit else jit.address(running.fit_dense, HOOK)
        words[at.ALONG] = int(running is galpha.SCHEME)
        words[at.REMEMBERED] = self.system.scene.state.memory.shape[1]
        words[at.JOINTS] = int(self.system.scene.world.hooks[Hook.JOINTS] != 0)
        words[at.FITTED] = 0
        joints = words[at.JOINTS] == 1
        self.arrays = self.arrays._replace(
            enough=enough(self.system, self._tol, words[at.ALONG] == 1),
            one_sided=one_sided(self.system, words[at.ALONG] == 1),
            weights=np.zeros(0) if joints or running.implicit else _weights(running),
            estimates=np.zeros((1, 0)) if running.implicit else _estimates(running),
            smooth=np.zeros(len(self.directions), dtype=np.int64),
            ready=np.zeros(len(self.directions), dtype=np.int64),
            told=np.zeros(len(self.directions), dtype=np.int64),
        )
        if self.arrays.dense.shape[1] != running.dense:
            self.arrays = self.arrays._replace(
                dense=np.zeros((len(self.directions), running.dense, n)),
                path=np.zeros((running.dense, n)),
            )
        self._pack()
        self._alive = kept

    def take(self) -> None:
        """Take the rows that were written beside the run's."""
        used, words = self.twin.scene.rows.used, self.arrays.words
        n, incidents, events = used.tolist()
        rows = int(words[at.ROWS])
        if rows:
            self.gathered.take(n, incidents, events)
            self._steps.append(self.arrays.step[:rows].copy())
        used[:] = 0
        words[at.ROWS] = 0

    def mark(self) -> None:
        """Remember where derivatives and rows are, for `go_back`."""
        kept = tags.copies(self.arrays, tags.STATE)
        self._mark = kept, self.gathered.copied(), list(self._steps)

    def go_back(self) -> None:
        """Go back to what was marked."""
        kept, rows, self._steps = self._mark
        dense = kept["dense"]
        path = np.zeros(dense.shape[1:])
        self.arrays = self.arrays._replace(dense=dense, path=path)
        tags.put_back(self.arrays, tags.STATE, kept)
        self.gathered.restore(rows)
        self._pack()
        self.twin.scene.rows.used[:] = 0
        self.arrays.words[at.ROWS] = 0

    def _pack(self) -> None:
        """Let compiled code find the arrays."""
        self._words = pack(self.arrays)
        for system in (self.system, self.twin):
            system.scene.world.hooks[AT] = int(self._words.ctypes.data)

    def tables(self, asked: Sequence[str]) -> tuple[dict[str, Array], dict[str, dict[str, Any]]]:
        """Return derivatives of all signals by dataset, and attributes of each parameter's group.

        A derivative that is not known any more is NaN.
        """
        block, count = self.gathered.block, len(self.directions)
        steps = np.concatenate(self._steps) if self._steps else np.zeros((0, count))
        found: dict[str, Array] = {}
        about: dict[str, dict[str, Any]] = {}
        for k, direction in enumerate(self.directions):
            e = steps[:, k]
            sides = []
            for side in range(2):
                rows = slice(2 * k + side, None, 2 * count)
                sides.append(dict(signals(self.twin, _part(block, rows), SignalFilter(asked))))
            for name, up in sides[0].items():
                if name.startswith(_NO_SIGNALS) or up.dtype.kind != "f":
                    continue
                wide = e.reshape(-1, *[1] * (up.ndim - 1))
                found[f"sensitivity/{direction.name}/{name}"] = (up - sides[1][name]) / (2.0 * wide)
            about[f"sensitivity/{direction.name}"] = {
                "value": direction.value,
                "steps_along": int(self.arrays.words[at.BENT]),
                "evaluations": int(self.arrays.words[at.ASKED]),
                "known_to": float(self._known_to[k]),
                "known_until": float(self.arrays.lost[k]),
                "why": self._why(int(self.arrays.why[k])),
            }
        return found, about

    @property
    def _known_to(self) -> Array:
        """What derivatives may be off by, over their largest value: errors are of usual sizes."""
        return UNSEEN * self.arrays.enough[0] / np.maximum(self.arrays.largest, 1e-300)

    def _why(self, code: int) -> str:
        """Return why a derivative is not known, and which subroutines it may be for."""
        named = f": {', '.join(self._users)}" if code == at.LOST_USER else ""
        return _WHY.get(code, "") + named

    @property
    def lines(self) -> list[str]:
        """What is to be said of derivatives that are not known to the end, or not well."""
        small = [
            f"warning: sensitivity to {direction.name}: it changes the motion so little that it is "
            f"known to {part:.1g} of its largest value; a smaller tol tells more"
            for direction, part, effect in zip(
                self.directions, self._known_to, self.arrays.largest, strict=True
            )
            if part > KNOWN_TO and 0.0 < effect < LITTLE
        ]
        return small + [
            f"warning: sensitivity to {direction.name}: not known from time {lost:.6g} on: "
            f"{self._why(int(why))}"
            for direction, lost, why in zip(
                self.directions, self.arrays.lost, self.arrays.why, strict=True
            )
            if lost < math.inf
        ]


def _of_jumps(count: int, n: int) -> dict[str, Any]:
    """Return arrays of `timed` and of rows, for so many parameters and numbers of y; `_FLAGS`."""
    return {name: np.zeros(count, dtype=np.int64) for name in _FLAGS} | {
        "shown_error": np.zeros(count),
        "largest": np.zeros(count),
        "rate": np.full(count, 0.99),
        "moved": np.zeros(count),
        "gap": np.full(3, math.nan),
        "moves": np.zeros((count, 2)),
        "shown": np.zeros((count, 2)),
        "shrink": np.ones(count),
        "fall": np.zeros((count, n)),
        "sides": np.zeros((SIDES, n)),
    }


def _users(system: System) -> list[str]:
    """Return the users' subroutines on which forces depend, by element."""
    found: list[tuple[str, Any]] = [(f"Force_Contact[{id}]", u) for id, u in system.user_laws]
    found += [(f"Force_Element[{id}]", user) for id, user in system.residuals.items()]
    found += [(f"{s}[{id}]", user) for (s, id), user in system.subroutines.items() if user.acts]
    return sorted({f"{element}: {user.name}" for element, user in found})


def _part(block: Block, rows: slice) -> Block:
    """Return some of the rows of a block, without incidents."""
    fields = {f.name: getattr(block, f.name) for f in dataclasses.fields(Block)}
    without = {name: fields[name][:0] for name in ("incidents", "points", "events")}
    return Block(**{name: table[rows] for name, table in fields.items()} | without)


def _weights(running: scheme.Scheme) -> Array:
    """Return by what weights an explicit method adds up its stages."""
    from mbsim.integrators import dop853, dopri5

    if running is dop853.SCHEME:
        return np.array(dop853.A[12][:12])
    return np.array((dopri5.B1, 0.0, dopri5.B3, dopri5.B4, dopri5.B5, dopri5.B6))


def _estimates(running: scheme.Scheme) -> Array:
    """Return by what weights an explicit method adds up its stages to errors."""
    from mbsim.integrators import dop853, dopri5

    if running is dop853.SCHEME:
        found = np.zeros((2, 13))
        found[0, :12], found[1, :12] = dop853.E5[0], dop853.E3[0]
        return found
    five = dopri5
    return np.array(((five.E1, 0.0, five.E3, five.E4, five.E5, five.E6, five.E7),))

"""User subroutines of a model as rows of `Users`, and what they may ask of the trial state.

REQSUB is called when an output row is written and may ask for forces and accelerations too.

`py_sysfnc("DX", [i, j])` becomes an instruction of the stack machine, kept by name and ids. It
is put in the place of one spare program and run by the hook of expressions, so that it
measures at the state at which the subroutine is called, and by the same code as an expression.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import ANGLE, Instruction
from mbsim.compile_model.programs import ProgramTable
from mbsim.core.address import pack
from mbsim.errors import DeckError
from mbsim.expressions.elementary import TIME
from mbsim.expressions.functions import CONTACT_BY_INDEX, FUNCTIONS, Kind
from mbsim.expressions.parse import ExpressionError, check_arguments
from mbsim.expressions.tree import Call as Function
from mbsim.expressions.tree import Number
from mbsim.model.elements import Differential, Model, Variable
from mbsim.model.subroutines import Call, wanted
from mbsim.plugins.guard import PassedOn
from mbsim.plugins.helpers import host
from mbsim.plugins.source.script import Scripts
from mbsim.plugins.subroutine import UserSubroutine, check_rates, load_subroutine

#: Angles that subroutines may follow over whole turns, beyond those that the deck names.
SPARE_ANGLES = 32

#: What py_sysary gives: functions and how many of the ids each takes.
ARRAYS: dict[str, tuple[tuple[str, int], ...]] = {
    "TDISP": (("DX", 3), ("DY", 3), ("DZ", 3)),
    "RDISP": (("PSI", 2), ("THETA", 2), ("PHI", 2)),
    "TVEL": (("VX", 4), ("VY", 4), ("VZ", 4)),
    "RVEL": (("WX", 3), ("WY", 3), ("WZ", 3)),
    "TACC": (("ACCX", 4), ("ACCY", 4), ("ACCZ", 4)),
    "RACC": (("WDTX", 4), ("WDTY", 4), ("WDTZ", 4)),
    "TFORCE": (("FX", 3), ("FY", 3), ("FZ", 3)),
    "RFORCE": (("TX", 3), ("TY", 3), ("TZ", 3)),
}
for _whole in ("DISP", "VEL", "ACC", "FORCE"):
    ARRAYS[_whole] = ARRAYS[f"T{_whole}"] + ARRAYS[f"R{_whole}"]
#: What may be asked for always, and only where all is known: in a REQSUB.
_ALWAYS = (Kind.DISPLACEMENT, Kind.VELOCITY, Kind.STATE)
_AT_ROWS = (Kind.FORCE, Kind.ACCELERATION)


def load(
    model: Model, plugins: Sequence[Path], scripts: Scripts
) -> dict[tuple[str, int], UserSubroutine]:
    """Return the subroutines by (kind, id) of their elements, in order of their rows."""
    found = {}
    span = _span(model)
    for each in wanted(model):
        user = load_subroutine(each, plugins, scripts, model.file, span)
        if each.call is Call.MOTION:
            check_rates(user, each, *span, model.file)
        found[each.kind, each.id] = user
    return found


def _span(model: Model) -> tuple[float, float]:
    """Return the times over which a deck runs, a unit of time where it does not say."""
    times = [t for s in model.simulations for t in (s.start_time, s.end_time)]
    begin, end = min(times, default=0.0), max(times, default=1.0)
    return begin, end if end > begin else begin + 1.0


class StateReader:
    """What `py_sysfnc` and `py_sysary` look at; made before the programs become arrays."""

    def __init__(self, model: Model, programs: ProgramTable) -> None:
        self.programs, self.markers = programs, programs.markers
        for id in self.markers.placement.markers:
            for axis in (0, 1):
                self.markers.turned(self.markers.row(id), axis)
        for axis in (0, 1):
            self.markers.turned(0, axis)
        self.markers.spare_angles = SPARE_ANGLES
        # those of forces are not known while forces are summed, but in a REQSUB
        self.always: dict[tuple[str, int], int] = {}
        self.at_rows: dict[tuple[str, int], int] = {}
        requests = any(request.user for request in model.requests.values())
        for name, table in (("VARVAL", model.variables), ("DIF1", model.differentials)):
            for element in table.values():
                self._add(name, element, requests)
        self.spare = len(programs.programs)
        programs.programs.append([Instruction(TIME)])
        self.open_programs: list[int] = []
        self.known: dict[tuple[Any, ...], bytes | int | None] = {}

    def _add(self, name: str, element: Variable | Differential, at_rows: bool) -> None:
        """Make the program of a variable or of a slope, if it may be asked for."""
        key = name, element.id
        try:
            self.always[key] = self.programs.add(element.expr, element)
            return
        except DeckError:
            if not at_rows:
                return
        self.at_rows[key] = self.programs.add(
            element.expr, element, forces=True, accelerations=True
        )

    def open(self, scene: Scene) -> None:
        """Look at this scene from now on."""
        self.scene = scene
        at = int(scene.programs.quick_start[self.spare])
        self.instruction = scene.programs.quick[at].ctypes.data
        self.words = scene.programs.quick.shape[1]
        self.values = scene.programs.values.data
        self.shown = b""
        self.run: Callable[..., float] | None = None
        host.sysfnc, host.sysary = self.sysfnc, self.sysary
        if len(scene.users.seen) > 0:
            self.table = pack(scene)
            host.seen = (self.table.ctypes.data, scene.users.seen.ctypes.data)

    def hook(self) -> Callable[..., float]:
        """Return the hook of expressions, which is filled after the scene is made."""
        if self.run is None:
            number, real = ctypes.c_int64, ctypes.c_double
            kind = ctypes.CFUNCTYPE(real, number, real, number, number)
            self.run = kind(int(self.scene.world.hooks[Hook.VALUE]))
        return self.run

    def sysfnc(self, name: str, ids: Sequence[float]) -> list[Any]:
        """Return [value, errflg] of a function at the state of the call that is being served."""
        key = (host.at_row, name, *ids)
        try:
            found = self.known[key]
        except KeyError:
            found = self.known[key] = self.resolve(name, ids)
        if found is None or host.state is None:
            return [0.0, 1]
        return [self.value(found), 0]

    def sysary(self, name: str, ids: Sequence[float]) -> list[Any]:
        """Return [values, errflg] of several functions of the same markers."""
        parts = ARRAYS.get(str(name).strip().upper())
        if parts is None:
            return [[], 1]
        found = [self.sysfnc(part, tuple(ids)[:count]) for part, count in parts]
        if any(flag for _, flag in found):
            return [[0.0] * len(parts), 1]
        return [[value for value, _ in found], 0]

    def value(self, found: bytes | int) -> float:
        """Return the value of an instruction, or of the program of a variable."""
        assert host.state is not None
        if isinstance(found, int):
            return self.variable(found)
        if found is not self.shown:
            ctypes.memmove(self.instruction, found, len(found))
            self.shown = found
        scene, time, y = host.state
        # one measure leaves the stack alone: its value is what is returned
        return self.hook()(scene, time, y, self.spare)

    def variable(self, program: int) -> float:
        """Return the value of the program of a variable."""
        assert host.state is not None
        if program in self.open_programs:
            raise RecursionError("variables or slopes that need each other by py_sysfnc")
        scene, time, y = host.state
        if host.seen is not None and y == host.seen[1]:
            # what was noted before, as where a law is explored, is not of this call
            self.scene.users.failed[0] = 0
        # an expression that is half done may stand on the stack
        kept = self.values.tobytes()
        self.open_programs.append(program)
        try:
            value = self.hook()(scene, time, y, program)
        finally:
            self.open_programs.pop()
        self.values.cast("B")[:] = kept
        if self.scene.users.failed[0] != 0:
            raise PassedOn
        return value

    def resolve(self, name: str, ids: Sequence[float]) -> bytes | int | None:
        """Return an instruction as `Programs.code` has it, or a variable's program, or None."""
        name = str(name).strip().upper()
        if any(float(id) != int(id) for id in ids):
            return None
        if name in ("VARVAL", "DIF1"):
            known = self.always | self.at_rows if host.at_row else self.always
            return known.get((name, int(ids[0]))) if len(ids) == 1 else None
        if name == "CONTACT" and len(ids) == 3:
            name = CONTACT_BY_INDEX
        function = FUNCTIONS.get(name)
        allowed = _ALWAYS + _AT_ROWS if host.at_row else _ALWAYS
        if function is not None and function.kind in _AT_ROWS and not host.at_row:
            host.log(
                f"warning: py_sysfnc {name}: {function.kind.value} follow from what subroutines "
                "give, so they are not known yet: errflg is 1"
            )
        if function is None or function.kind not in allowed:
            return None
        if not function.least <= len(ids) <= len(function.args):
            return None
        node = Function(name, tuple(Number(float(id)) for id in ids))
        try:
            check_arguments(function, list(node.args), 1)
            instruction = self.programs.measure(node)
            given = self.programs.rows_of(instruction)
        except (ExpressionError, KeyError):
            return None
        if instruction.op == ANGLE and not self.follow(instruction.rows[0]):
            return None
        words = np.zeros(self.words, dtype=np.int64)
        words[0] = instruction.op
        words[1 : 1 + len(given)] = given
        return words.tobytes()

    def follow(self, row: int) -> bool:
        """Follow a new angle from now on; return whether there is room."""
        angles = self.scene.angles
        if row >= len(angles.i):
            host.log(f"warning: py_sysfnc follows no more than {SPARE_ANGLES} angles: errflg is 1")
            return False
        angles.i[row], angles.j[row] = list(self.markers.angle_rows)[row]
        return True

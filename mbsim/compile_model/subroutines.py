"""User subroutines of a model as rows of `Users`, and what they may ask of the trial state.

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
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.parse import ExpressionError
from mbsim.expressions.tree import Call, Number
from mbsim.model.elements import Model
from mbsim.model.subroutines import wanted
from mbsim.plugins.guard import PassedOn
from mbsim.plugins.helpers import host
from mbsim.plugins.source.script import Scripts
from mbsim.plugins.subroutine import UserSubroutine, load_subroutine

#: Angles that subroutines may follow over whole turns, beyond those that the deck names.
SPARE_ANGLES = 32

#: What py_sysary gives: functions and how many of the ids each takes.
ARRAYS: dict[str, tuple[tuple[str, int], ...]] = {
    "TDISP": (("DX", 3), ("DY", 3), ("DZ", 3)),
    "RDISP": (("PSI", 2), ("THETA", 2), ("PHI", 2)),
    "TVEL": (("VX", 4), ("VY", 4), ("VZ", 4)),
    "RVEL": (("WX", 3), ("WY", 3), ("WZ", 3)),
}
ARRAYS["DISP"] = ARRAYS["TDISP"] + ARRAYS["RDISP"]
ARRAYS["VEL"] = ARRAYS["TVEL"] + ARRAYS["RVEL"]


def load(
    model: Model, plugins: Sequence[Path], scripts: Scripts
) -> dict[tuple[str, int], UserSubroutine]:
    """Return the subroutines of forces and variables by (statement, id), in order of their rows."""
    return {
        (statement, id): load_subroutine(user, (xml, id), count, plugins, scripts, model.file)
        for statement, xml, id, user, count in wanted(model)
    }


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
        self.variables: dict[int, int] = {}
        for variable in model.variables.values():
            try:
                self.variables[variable.id] = programs.add(variable.expr, variable)
            except DeckError:
                continue  # one of forces, which are not known while they are summed
        self.spare = len(programs.programs)
        programs.programs.append([Instruction(TIME)])
        self.open_programs: list[int] = []
        self.known: dict[tuple[Any, ...], bytes | int | None] = {}

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
        key = (name, *ids)
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
            raise RecursionError("variables that need each other by py_sysfnc")
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
        if name == "VARVAL":
            return self.variables.get(int(ids[0])) if len(ids) == 1 else None
        function = FUNCTIONS.get(name)
        if function is not None and function.kind in (Kind.FORCE, Kind.ACCELERATION):
            host.log(
                f"warning: py_sysfnc {name}: {function.kind.value} follow from what subroutines "
                "give, so they are not known yet: errflg is 1"
            )
        if function is None or function.kind not in (Kind.DISPLACEMENT, Kind.VELOCITY):
            return None
        if not function.least <= len(ids) <= len(function.args):
            return None
        node = Call(name, tuple(Number(float(id)) for id in ids))
        try:
            instruction = self.programs.measure(node)
        except ExpressionError:
            return None
        if instruction.op == ANGLE and not self.follow(instruction.rows[0]):
            return None
        words = np.zeros(self.words, dtype=np.int64)
        words[0] = instruction.op
        words[1 : 1 + len(instruction.rows)] = instruction.rows
        return words.tobytes()

    def follow(self, row: int) -> bool:
        """Follow a new angle from now on; return whether there is room."""
        angles = self.scene.angles
        if row >= len(angles.i):
            host.log(f"warning: py_sysfnc follows no more than {SPARE_ANGLES} angles: errflg is 1")
            return False
        angles.i[row], angles.j[row] = list(self.markers.angle_rows)[row]
        return True

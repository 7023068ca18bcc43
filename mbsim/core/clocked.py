"""Functions that count the time of what they call; see `core.profile`.

For each an own one is made, of a few instructions, in LLVM's language: Numba would take a second.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from llvmlite import ir

from mbsim.core.signature import FLOAT, INT, Kind, Signature

#: Columns of a part's row in the table of counts, and of the row behind the last part.
TICKS, CALLS = range(2)
LAST, CURRENT = range(2)

_WORD = ir.IntType(64)


def _llvm_type(given: Kind) -> Any:
    """Return how C passes a value."""
    if given == FLOAT:
        return ir.DoubleType()
    return _WORD if given == INT else ir.IntType(8).as_pointer()


def _ticks(builder: ir.IRBuilder) -> Any:
    """Read the processor's counter."""
    kind = ir.FunctionType(_WORD, [])
    name = "llvm.readcyclecounter"
    found = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
    return builder.call(found, [])


class _Table(NamedTuple):
    """Where counts are kept, and the row behind the last part."""

    address: int
    last: int

    def cell(self, builder: ir.IRBuilder, row: Any, column: int) -> Any:
        """Return the pointer to a number of the table."""
        start = builder.inttoptr(ir.Constant(_WORD, self.address), _WORD.as_pointer())
        at = builder.mul(row, ir.Constant(_WORD, 2))
        return builder.gep(start, [builder.add(at, ir.Constant(_WORD, column))])

    def pass_time(self, builder: ir.IRBuilder, row: Any) -> None:
        """Count to a part what has passed since it was counted last."""
        now, last = _ticks(builder), self.cell(builder, ir.Constant(_WORD, self.last), LAST)
        ticks = self.cell(builder, row, TICKS)
        passed = builder.sub(now, builder.load(last))
        builder.store(builder.add(builder.load(ticks), passed), ticks)
        builder.store(now, last)


def _define(
    module: ir.Module, name: str, table: _Table, address: int, part: int, signature: Signature
) -> None:
    """Define a function that calls `address` and counts to a part, less those within it."""
    arguments = [_llvm_type(each) for each in signature.arguments]
    kind = ir.FunctionType(_llvm_type(signature.result), arguments)
    function = ir.Function(module, kind, name)
    builder = ir.IRBuilder(function.append_basic_block())
    own = ir.Constant(_WORD, part)
    current = table.cell(builder, ir.Constant(_WORD, table.last), CURRENT)
    before = builder.load(current)
    table.pass_time(builder, before)
    builder.store(own, current)
    calls = table.cell(builder, own, CALLS)
    builder.store(builder.add(builder.load(calls), ir.Constant(_WORD, 1)), calls)
    inner = builder.inttoptr(ir.Constant(_WORD, address), kind.as_pointer())
    answer = builder.call(inner, function.args)
    table.pass_time(builder, own)
    builder.store(before, current)
    builder.ret(answer)


def _compiled(module: ir.Module) -> Any:
    """Return the engine that holds a module's machine code; it must live as long as that."""
    target = llvm.Target.from_default_triple()
    machine = target.create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(str(module)), machine)
    engine.finalize_object()
    return engine


def compile_counter() -> tuple[Any, Callable[[], int]]:
    """Return what reads the processor's counter, behind what must live as long."""
    module = ir.Module("counter")
    function = ir.Function(module, ir.FunctionType(_WORD, []), "mbsim_ticks")
    builder = ir.IRBuilder(function.append_basic_block())
    builder.ret(_ticks(builder))
    engine = _compiled(module)
    return engine, ctypes.CFUNCTYPE(ctypes.c_int64)(engine.get_function_address(function.name))


def compile_clocked(
    address: int, part: int, signature: Signature, table: int, last: int
) -> tuple[Any, int]:
    """Return the address of what counts, behind what must live as long.

    Parameters
    ----------
    address : int
        Of the function that it calls.
    part : int
        Row of the table that it counts to.
    table : int
        Address of the table of counts, int64, shape (last + 1, 2).
    last : int
        Row behind those of parts.
    """
    module, name = ir.Module("clocked"), f"mbsim_clocked_{address:x}_{part}"
    _define(module, name, _Table(table, last), address, part, signature)
    engine = _compiled(module)
    return engine, int(engine.get_function_address(name))

"""What Numba lowers, in as few instructions as it takes: LLVM would find the same, but later.

Half of what Numba lowers is there to be removed again: variables in memory that are assigned once,
members of what has just been put together, checks for handlers that a function has not. It is built
by Python, written as text, parsed and only then simplified. What is computed is the same.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from llvmlite import ir as llvm
from llvmlite.ir import instructions
from numba.core import analysis, callconv, cgutils, ir, lowering
from numba.core.unsafe import eh

from mbsim.core.numba_costs import is_counted

_extract_value = llvm.IRBuilder.extract_value


def _member(self: Any, agg: Any, idx: Any, name: str = "") -> Any:
    """Return a member of a value: what was put into it, where that was seen."""
    path = tuple(idx) if isinstance(idx, list | tuple) else (idx,)
    found = agg
    while path:
        if isinstance(found, instructions.InsertValue):
            put = tuple(found.indices)
            if put == path[: len(put)]:
                found, path = found.value, path[len(put) :]
            elif path == put[: len(path)]:
                break  # a part of what is asked for
            else:
                found = found.aggregate
        elif isinstance(found, llvm.Constant):
            part = _constant_member(found, path[0])
            if part is None:
                break
            found, path = part, path[1:]
        else:
            break
    return _extract_value(self, found, path, name) if path else found


def _constant_member(value: Any, place: int) -> Any:
    """Return a member of a constant, None where it is not written as such."""
    kind = value.type.elements[place]
    if value.constant is None or value.constant is llvm.Undefined:
        return llvm.Constant(kind, value.constant)
    if isinstance(value.constant, list | tuple):
        part = value.constant[place]
        return part if isinstance(part, llvm.Constant) else None
    return None


def _has_handlers(blocks: Iterable[Any]) -> bool:
    """Return whether a function catches anything."""
    return any(
        isinstance(assign.value, ir.Global | ir.FreeVar)
        and getattr(assign.value.value, "__module__", None) == eh.__name__
        for block in blocks
        for assign in block.find_insts(ir.Assign)
    )


def _find_assigned_once(self: Any) -> None:
    """Find the variables that need no memory: assigned once, on every way to where they are used.

    Numba takes those that are used in one block only.
    """
    blocks = self.func_ir.blocks
    found = self._singly_assigned_vars = set()
    self._blk_local_varmap = {}
    self.builds_plainly = False
    if self.func_ir.func_id.is_generator:
        return
    catches = _has_handlers(blocks.values())
    self.builds_plainly = not (catches or self._disable_sroa_like_opt)
    assigned, deleted = _assignments(blocks)
    used = defaultdict(set)
    for at, names in analysis.compute_use_defs(blocks).usemap.items():
        for name in names:
            used[name].add(at)
    kept = analysis.must_use_alloca(blocks)
    graph: Any = None
    for name, at in assigned.items():
        if at is None or name in kept:
            continue
        if not used[name]:
            found.add(name)
            continue
        if not self.builds_plainly or at in used[name]:
            continue
        if graph is None:
            graph = analysis.compute_cfg_from_blocks(blocks)
            dominators = graph.dominators()
        needed = used[name]
        if is_counted(self.context, self.typeof(name)):
            if _is_deleted_twice(graph, deleted[name]):
                continue
            needed = needed.union(deleted[name]) - {at}
        if all(at < other and at in dominators[other] for other in needed):
            found.add(name)


def _assignments(blocks: Any) -> tuple[dict[str, Any], dict[str, list[Any]]]:
    """Return by variable its block if it is assigned once, else None, and where it is deleted."""
    assigned: dict[str, Any] = {}
    deleted = defaultdict(list)
    for at, block in blocks.items():
        for statement in block.body:
            if isinstance(statement, ir.Assign):
                name = statement.target.name
                assigned[name] = None if name in assigned else at
            elif isinstance(statement, ir.Del):
                deleted[statement.value].append(at)
    return assigned, deleted


def _is_deleted_twice(graph: Any, places: list[Any]) -> bool:
    """Return whether a way leads from one of the blocks to another, or to itself again."""
    wanted, seen = set(places), set()
    stack = [follower for place in places for follower, _ in graph.successors(place)]
    while stack:
        at = stack.pop()
        if at in wanted:
            return True
        if at not in seen:
            seen.add(at)
            stack.extend(follower for follower, _ in graph.successors(at))
    return len(wanted) < len(places)


_store_variable: Any = lowering.Lower.storevar
_delete_variable: Any = lowering.Lower.delvar


def _store(self: Any, value: Any, name: str, argidx: Any = None) -> None:
    """Store a variable; the value that it had need not be looked at where nothing is counted."""
    if name in self._singly_assigned_vars or is_counted(self.context, self.typeof(name)):
        _store_variable(self, value, name, argidx)
        return
    place = self.getvar(name)
    if value.type != place.type.pointee:
        raise AssertionError(f"{name} is no {value.type}")
    self.builder.store(value, place)


def _delete(self: Any, name: str) -> None:
    """Delete a variable, if it counts."""
    if is_counted(self.context, self.typeof(name)):
        _delete_variable(self, name)


_set_up_function: Any = lowering.BaseLower.setup_function


def _set_up(self: Any, fndesc: Any) -> None:
    """Begin a function, and note whether it has handlers."""
    _set_up_function(self, fndesc)
    self.builder.builds_plainly = getattr(self, "builds_plainly", False)


_call_function: Any = callconv.CPUCallConv.call_function
_propagate: Any = callconv.CPUCallConv.return_status_propagate


class _Status:
    """What a call returned; what is asked of it is found where it is asked."""

    def __init__(self, builder: Any, code: Any, error: Any) -> None:
        self._builder, self.code, self.excinfoptr = builder, code, error

    def _is(self, code: Any, how: str = "==") -> Any:
        return self._builder.icmp_signed(how, self.code, code)

    @property
    def is_ok(self) -> Any:
        return self._builder.or_(self._is(callconv.RETCODE_OK), self.is_none)

    @property
    def is_error(self) -> Any:
        return self._builder.not_(self.is_ok)

    @property
    def is_none(self) -> Any:
        return self._is(callconv.RETCODE_NONE)

    @property
    def is_python_exc(self) -> Any:
        return self._is(callconv.RETCODE_EXC)

    @property
    def is_stop_iteration(self) -> Any:
        return self._is(callconv.RETCODE_STOPIT)

    @property
    def is_user_exc(self) -> Any:
        return self._is(callconv.RETCODE_USEREXC, ">=")


def _call(
    self: Any, builder: Any, callee: Any, resty: Any, argtys: Any, args: Any, attrs: Any = None
) -> Any:
    """Call a compiled function; what it raises, it leaves where this function's caller looks."""
    if attrs is not None or not getattr(builder, "builds_plainly", False):
        return _call_function(self, builder, callee, resty, argtys, args, attrs)
    kind = self.get_return_type(resty).pointee
    if kind != self._get_return_argument(callee.function_type).pointee:
        raise ValueError(f"the function does not return {kind}")
    with builder.goto_entry_block():
        place = builder.alloca(kind)
    builder.store(cgutils.get_null_value(kind), place)
    error = self._get_excinfo_argument(builder.function)
    given = self._get_arg_packer(argtys).as_arguments(builder, args)
    code = builder.call(callee, [place, error, *given])
    value = self.context.get_returned_value(builder, resty, builder.load(place))
    return _Status(builder, code, error), value


def _hand_on(self: Any, builder: Any, status: Any) -> None:
    """Return what a call failed with."""
    if isinstance(status, _Status):
        self._return_errcode_raw(builder, status.code)
    else:
        _propagate(self, builder, status)


#: What may be left out where nobody uses its result.
_WITHOUT_EFFECT = frozenset(
    "insertvalue extractvalue getelementptr inttoptr ptrtoint bitcast zext sext trunc sitofp "
    "add sub mul and or xor shl ashr lshr icmp fcmp fadd fsub fmul fdiv select load alloca".split()
)


def leave_out_unused(module: Any) -> None:
    """Remove from a module what has no effect and is not used, and variables that nobody reads."""
    for function in module.functions:
        uses: dict[int, int] = defaultdict(int)
        for block in function.blocks:
            for instruction in block.instructions:
                for operand in _read_by(instruction):
                    uses[id(operand)] += 1
        for block in reversed(function.blocks):
            kept = []
            for instruction in reversed(block.instructions):
                if _is_used(instruction, uses):
                    kept.append(instruction)
                    if isinstance(instruction, instructions.StoreInstr):
                        uses[id(instruction.operands[1])] += 1  # it stays, and so does its place
                else:
                    for operand in _read_by(instruction):
                        uses[id(operand)] -= 1
            kept.reverse()
            block.instructions[:] = kept


def _read_by(instruction: Any) -> Any:
    """Return the values that an instruction reads: the place that it stores to is none."""
    if isinstance(instruction, instructions.StoreInstr) and _is_variable(instruction):
        return instruction.operands[:1]
    if isinstance(instruction, instructions.PhiInstr):
        return [value for value, _ in instruction.incomings]
    return instruction.operands


def _is_variable(store: Any) -> bool:
    return type(store.operands[1]) is instructions.AllocaInstr


def _is_used(instruction: Any, uses: dict[int, int]) -> bool:
    """Return whether an instruction has an effect or a reader."""
    if isinstance(instruction, instructions.StoreInstr):
        return not _is_variable(instruction) or uses[id(instruction.operands[1])] > 0
    return uses[id(instruction)] > 0 or instruction.opname not in _WITHOUT_EFFECT


#: What is put in place of what: a class of Numba's, a name in it, and ours.
_REPLACED: tuple[tuple[Any, str, Any], ...] = (
    (llvm.IRBuilder, "extract_value", _member),
    (lowering.Lower, "_find_singly_assigned_variable", _find_assigned_once),
    (lowering.Lower, "storevar", _store),
    (lowering.Lower, "delvar", _delete),
    (lowering.BaseLower, "setup_function", _set_up),
    (callconv.CPUCallConv, "call_function", _call),
    (callconv.CPUCallConv, "return_status_propagate", _hand_on),
)


def install() -> None:
    """Put these in place of Numba's for the rest of the process."""
    for owner, name, ours in _REPLACED:
        setattr(owner, name, ours)

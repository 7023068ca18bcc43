"""Numba's own bookkeeping, done once and not again for every function that is compiled.

Each function here gives what Numba's own gives, in less time. They are put in place only where
`core.linking` is.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

from llvmlite import ir as llvm
from numba import stencil
from numba.core import (
    analysis,
    base,
    compiler_machinery,
    errors,
    event,
    inline_closurecall,
    interpreter,
    ir,
    lowering,
    postproc,
    targetconfig,
    transforms,
    typed_passes,
    typeinfer,
    types,
)
from numba.core.base import BaseContext
from numba.core.ir_utils import enforce_no_dels
from numba.core.registry import cpu_target
from numba.core.rewrites.registry import rewrite_registry
from numba.core.runtime.context import NRTContext
from numba.core.types.functions import BaseFunction
from numba.core.typing import npydecl, templates
from numba.np.ufunc import array_exprs
from numba.stencils.stencil import StencilFunc

from mbsim.core import array_items

_Made = TypeVar("_Made")
_once: Callable[[_Made], _Made] = cast(Any, functools.cache)  # classes are hashable
_equal_options: Any = targetconfig.TargetConfig.__eq__


def _same_options(self: Any, other: Any) -> Any:
    """Compare options that were set in one of the two: others have their class's default."""
    if type(self) is not type(other):
        return _equal_options(self, other)
    mine, others = self._values, other._values
    return mine == others or all(
        getattr(self, name) == getattr(other, name) for name in mine.keys() | others.keys()
    )


@_once
def _hash_of_class(kind: Any) -> int:
    return hash(tuple(sorted(kind.options)))


def _hash_of_options(self: Any) -> int:
    """Return the hash of the options' names, which is what Numba hashes: one a class."""
    return _hash_of_class(type(self))


_NONE, _VARIABLE, _INSTRUCTION, _SEQUENCE, _MAPPING = range(5)
_ROLES = (
    (ir.Var, _VARIABLE),
    (ir.Inst, _INSTRUCTION),
    ((list, tuple), _SEQUENCE),
    (dict, _MAPPING),
)


@_once
def _role(kind: Any) -> int:
    """Return what a part of an instruction is, by its type."""
    return next((role for base, role in _ROLES if issubclass(kind, base)), _NONE)


def _variables(self: Any, part: Any) -> list[Any]:
    """Return the variables in a part of an instruction, in their order."""
    role = _role(type(part))
    if role == _NONE:
        return []
    if role == _VARIABLE:
        return [part]
    if role == _INSTRUCTION:
        return list(part.list_vars())
    found: list[Any] = []
    for inner in part.values() if role == _MAPPING else part:
        found.extend(_variables(self, inner))
    return found


def _names_in(value: Any) -> Any:
    """Return the names of the variables in what is assigned."""
    kind = type(value)
    if kind is ir.Var:
        return (value.name,)
    if kind is not ir.Expr:
        return [variable.name for variable in _variables(None, value)]
    names = []
    for part in value._kws.values():
        if type(part) is ir.Var:
            names.append(part.name)
        elif _role(type(part)) != _NONE:
            names.extend(variable.name for variable in _variables(None, part))
    return names


def _uses_and_definitions(blocks: Any) -> Any:
    """Find the variables that each block reads before it sets them, and those that it sets."""
    used: dict[Any, set[str]] = {}
    defined: dict[Any, set[str]] = {}
    for at, block in blocks.items():
        reads, sets = used.setdefault(at, set()), defined.setdefault(at, set())
        for statement in block.body:
            if type(statement) in analysis.ir_extension_usedefs:
                analysis.ir_extension_usedefs[type(statement)](statement, reads, sets)
                continue
            if isinstance(statement, ir.Assign):
                names = _names_in(statement.value)
                if statement.target.name not in names:
                    sets.add(statement.target.name)
            else:
                names = [variable.name for variable in statement.list_vars()]
            reads.update(name for name in names if name not in sets)
    return analysis._use_defs_result(usemap=used, defmap=defined)


_delete_exit: Any = interpreter.peep_hole_delete_with_exit


def _delete_exit_of_with(func_ir: Any) -> Any:
    """Look for what a `with` leaves behind where a function has one."""
    for block in func_ir.blocks.values():
        for assign in block.find_insts(ir.Assign):
            if assign.target.name.startswith("$setup_with_exitfn"):
                return _delete_exit(func_ir)
    return func_ir


_has_location: Any = base._has_loc


def _takes_location(function: Any) -> bool:
    """Return whether a function has an argument `loc`: its code says it, without a signature."""
    if type(function) is not FunctionType or hasattr(function, "__wrapped__"):
        return bool(_has_location(function))
    code = function.__code__
    return "loc" in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]


_array_operator: Any = npydecl.NumpyRulesArrayOperator.generic


def _operator_on_arrays(self: Any, args: Any, kws: Any) -> Any:
    """Look for NumPy's loop of an operator only where an operand is an array."""
    plain = (a.type if isinstance(a, types.Optional) else a for a in args)
    if any(isinstance(a, types.ArrayCompatible) for a in plain):
        return _array_operator(self, args, kws)
    return None


def _import_declarations_once() -> None:
    """Look through Numba's registries for what is new without its fifty import statements.

    It runs these before every function that it compiles.
    """
    contexts = cpu_target.typing_context, cpu_target.target_context
    for context in contexts:
        context.refresh()
    for context in contexts:
        context.load_additional_registries = functools.partial(_look_through, context)
        context.refresh = functools.partial(_refresh, context)


def _look_through(context: Any) -> None:
    for registry in list(context._registries):
        context.install_registry(registry)


_known: dict[Any, int] = {}


def _refresh(context: Any) -> None:
    """Refresh a context where anything was registered since: the lists are only appended to."""
    target = cpu_target.target_context
    registries = [*target._registries, *cpu_target.typing_context._registries]
    now = sum(len(entries) for each in registries for entries in _lists(each))
    if _known.get(context) != now:
        type(context).refresh(context)
        _known[context] = now


@functools.cache
def _lists(registry: Any) -> list[Any]:
    """Return the lists of what is registered."""
    return [entries for entries in vars(registry).values() if isinstance(entries, list)]


_post_process: Any = postproc.PostProcessor.run


def _with_lifetimes_on_demand(
    self: Any, emit_dels: bool = False, extend_lifetimes: bool = False
) -> None:
    """Find which variables live where only for who asks: the pass that deletes them.

    It is done again after every change of the control flow.
    """
    ir_of_function = self.func_ir
    if emit_dels or ir_of_function.is_generator:
        _post_process(self, emit_dels, extend_lifetimes)
        return
    ir_of_function.blocks = transforms.canonicalize_cfg(ir_of_function.blocks)
    ir_of_function.variable_lifetime = postproc.VariableLifetime(ir_of_function.blocks)
    ir_of_function.generator_info = None


_count_references: Any = NRTContext._call_incref_decref


def _counted(context: Any, kind: Any) -> Any:
    """Return how a type is laid out if there may be reference counts in it, else None."""
    model = context.data_model_manager[kind]
    try:
        counted = model.is_counted
    except AttributeError:
        counted = model.is_counted = model.contains_nrt_meminfo()
    return model if counted else None


def is_counted(context: Any, kind: Any) -> bool:
    """Return whether there may be reference counts in values of a type."""
    return _counted(context, kind) is not None


def _count_where_counted(self: Any, builder: Any, typ: Any, value: Any, name: str) -> None:
    """Count references only to what may have some."""
    if _counted(self._context, typ) is not None:
        _count_references(self, builder, typ, value, name)


def _references(self: Any, builder: Any, ty: Any, val: Any) -> list[Any]:
    """Return (type, reference count) of all in a value that may have one."""
    model = _counted(self._context, ty)
    if model is None:
        return []
    found = []
    if model.has_nrt_meminfo():
        count = model.get_nrt_meminfo(builder, val)
        if not (isinstance(count, llvm.Constant) and count.constant is None):
            found.append((ty, count))
    for kind, taken in model.traverse(builder):
        if _counted(self._context, kind) is not None:
            found.extend(_references(self, builder, kind, taken(val)))
    return found


def _inherited() -> Any:
    """Return the caller's options that what it calls inherits, None outside of any function.

    As `CPUTargetOptions.finalize` has it.
    """
    caller: Any = targetconfig.ConfigStack.top_or_none()
    if caller is None:
        return None
    return caller.nrt, frozenset(caller.fastmath.flags), caller.error_model, caller.forceinline


def _form_for(self: Any, args: Any, kws: Any) -> Any:
    """Return the form of a function for these arguments, one for all callers that want the same.

    Numba's key has all options of the caller, so that what a C function and an inner function call
    is compiled twice alike.
    """
    key = self.context, tuple(args), tuple(kws.items()), _inherited()
    found = self._impl_cache.get(key)
    if found is None:
        found = self._build_impl(key, args, kws)
    return found


_call_type: Any = BaseFunction.get_call_type


def _call_type_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature that was found before for these arguments.

    Numba asks a dozen templates in turn, for each operation twice. A function type that gets
    another template is another function type.
    """
    key = context, tuple(args), tuple(kws.items()), _inherited()
    try:
        return self._found[key]
    except AttributeError:
        self._found = {}
    except KeyError:
        pass
    found = self._found[key] = _call_type(self, context, args, kws)
    return found


_errors: Any = errors  # its private names too


class _ErrorContext:
    """What an error within is said to have happened in: a plain object for a generator."""

    __slots__ = ("_args", "_format", "_named")

    def __init__(self, fmt_: str, *args: Any, **kwargs: Any) -> None:
        self._format, self._args, self._named = fmt_, args, kwargs

    def __enter__(self) -> None:
        loc = self._named.get("loc")
        if loc is not None and not loc.filename.startswith(_errors._numba_path):
            _errors.loc_info.update(self._named)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if isinstance(error, errors.NumbaError):
            error.add_context(_errors._format_msg(self._format, self._args, self._named))


_size_of, _alignment_of = BaseContext.get_abi_sizeof, BaseContext.get_abi_alignment
_sizes: dict[tuple[Any, str], int] = {}


def _measured(self: Any, measure: Any, ty: Any) -> int:
    """Return what LLVM says of a type without having it parse a module for each question."""
    text = str(ty)
    if "%" in text:  # what a name means is its module's own
        return int(measure(self, ty))
    key = measure, text
    if key not in _sizes:
        _sizes[key] = measure(self, ty)
    return _sizes[key]


_close_over: Any = inline_closurecall.InlineClosureCallPass.run
_INLINED_CALLS = (functools.reduce, stencil)


def _inline_where_there_is_something(self: Any) -> None:
    """Look for closures, comprehensions and stencils where a function has what they are made of."""
    for block in self.func_ir.blocks.values():
        for assign in block.find_insts(ir.Assign):
            value = assign.value
            if isinstance(value, ir.Expr):
                found = value.op in ("make_function", "build_list")
            elif isinstance(value, ir.Global | ir.FreeVar):
                named = value.value
                found = named in _INLINED_CALLS if callable(named) else False
                found = found or isinstance(named, StencilFunc)
            else:
                continue
            if found:
                _close_over(self)
                return


_rewrite: Any = typed_passes.NopythonRewrites.run_pass


def _rewrite_with_deletions_where_asked(self: Any, state: Any) -> bool:
    """Find where variables are deleted only for expressions of whole arrays, which ask for it."""
    types_of = state.typemap
    for block in state.func_ir.blocks.values():
        for assign in block.find_insts(ir.Assign):
            value = assign.value
            if not isinstance(value, ir.Expr):
                continue
            whole = isinstance(types_of.get(assign.target.name), types.Array)
            if value.op == "build_list" or (whole and _is_of_arrays(value, types_of)):
                return bool(_rewrite(self, state))
    rewrite_registry.apply("after-inference", state)
    return True


def _is_of_arrays(value: Any, types_of: Any) -> bool:
    """Return whether an expression may be one that Numba runs in a loop over whole arrays."""
    if value.op != "call":
        return value.op in ("unary", "binop", "inplace_binop")
    return bool(array_exprs._is_ufunc(getattr(types_of.get(value.func.name), "typing_key", None)))


_run_pass: Any = compiler_machinery.PassManager._runPass


def _run_pass_unmeasured(self: Any, index: int, pss: Any, state: Any) -> None:
    """Run a pass without taking times and texts of types for those who would look at them."""
    kind = "numba:run_pass"
    watched = len(event._registered[kind]) > 1 or self._print_after or self._print_before
    if watched or self._ENFORCING:
        _run_pass(self, index, pss, state)
        return
    pss.analysis = self._analysis
    event.start_event(kind)
    try:
        with _ErrorContext("Pass {name}", name=pss.name()):
            for step in (pss.run_initialization, pss.run_pass, pss.run_finalizer):
                step(state)
    finally:
        event.end_event(kind)
    if isinstance(pss, compiler_machinery.FunctionPass):
        enforce_no_dels(state.func_ir)
    none = compiler_machinery.pass_timings(0.0, 0.0, 0.0)
    self.exec_times[f"{index}_{pss.name()}"] = none


#: What is put in place of what: a class or module of Numba's, a name in it, and ours.
_REPLACED: tuple[tuple[Any, str, Any], ...] = (
    (targetconfig.TargetConfig, "__eq__", _same_options),
    (targetconfig.TargetConfig, "__hash__", _hash_of_options),
    (ir.Inst, "_rec_list_vars", _variables),
    (analysis, "compute_use_defs", _uses_and_definitions),
    (inline_closurecall, "compute_use_defs", _uses_and_definitions),
    (transforms, "compute_use_defs", _uses_and_definitions),
    (interpreter, "peep_hole_delete_with_exit", _delete_exit_of_with),
    (base, "_has_loc", _takes_location),
    (npydecl.NumpyRulesArrayOperator, "generic", _operator_on_arrays),
    (postproc.PostProcessor, "run", _with_lifetimes_on_demand),
    (NRTContext, "_call_incref_decref", _count_where_counted),
    (NRTContext, "get_meminfos", _references),
    (typed_passes.NopythonRewrites, "run_pass", _rewrite_with_deletions_where_asked),
    (BaseFunction, "get_call_type", _call_type_once),
    (templates._OverloadFunctionTemplate, "_get_impl", _form_for),
    (errors, "new_error_context", _ErrorContext),
    (lowering, "new_error_context", _ErrorContext),
    (typeinfer, "new_error_context", _ErrorContext),
    (BaseContext, "get_abi_sizeof", functools.partialmethod(_measured, _size_of)),
    (BaseContext, "get_abi_alignment", functools.partialmethod(_measured, _alignment_of)),
    (inline_closurecall.InlineClosureCallPass, "run", _inline_where_there_is_something),
    (compiler_machinery.PassManager, "_runPass", _run_pass_unmeasured),
)


def install() -> None:
    """Put these in place of Numba's for the rest of the process."""
    for owner, name, ours in _REPLACED:
        setattr(owner, name, ours)
    array_items.install()
    _import_declarations_once()

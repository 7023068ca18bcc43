"""Numba's own bookkeeping, done once and not again for every function that is compiled.

Each function here gives what Numba's own gives, in less time. They are put in place only where
`core.linking` is.
"""

from __future__ import annotations

import functools
from typing import Any

from numba.core import ir, targetconfig, types
from numba.core.registry import cpu_target
from numba.core.typing import npydecl

_equal_options = targetconfig.TargetConfig.__eq__


def _same_options(self: Any, other: Any) -> Any:
    """Compare options that were set in one of the two: others have their class's default."""
    if type(self) is not type(other):
        return _equal_options(self, other)
    mine, others = self._values, other._values
    return mine == others or all(
        getattr(self, name) == getattr(other, name) for name in mine.keys() | others.keys()
    )


@functools.cache
def _hash_of_class(kind: type) -> int:
    return hash(tuple(sorted(kind.options)))  # type: ignore[attr-defined]


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


@functools.cache
def _role(kind: type) -> int:
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


_array_operator = npydecl.NumpyRulesArrayOperator.generic


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


def _look_through(context: Any) -> None:
    for registry in list(context._registries):
        context.install_registry(registry)


def install() -> None:
    """Put these in place of Numba's for the rest of the process."""
    targetconfig.TargetConfig.__eq__ = _same_options  # type: ignore[method-assign,assignment]
    targetconfig.TargetConfig.__hash__ = _hash_of_options  # type: ignore[method-assign]
    ir.Inst._rec_list_vars = _variables
    npydecl.NumpyRulesArrayOperator.generic = _operator_on_arrays
    _import_declarations_once()

"""From the text of a whitelisted function to machine code that is kept across processes."""

from __future__ import annotations

import ast
import functools
import hashlib
import os
import re
import sys
import types
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mbsim.core import jit
from mbsim.core.code_cache import trusted_root
from mbsim.plugins.adapters.friction import friction_address
from mbsim.plugins.compile.rewrite import rewritten
from mbsim.plugins.compile.whitelist import Refused, check, module_globals

#: `par` becomes a tuple; a longer one would make compilation slow
PAR_MAX = 32


def compile_friction(
    text: str, values: dict[str, Any], name: str, par_count: int, states: int = 0
) -> tuple[int, str]:
    """Return the address of a compiled CFFSUB and '', or 0 and the reason why there is none.

    `values` is the namespace of the script after it has run: a name that its module binds
    once to a number is a constant. With `states` it keeps so many numbers of its own.
    """
    adapted = functools.partial(friction_address, states=states)
    return _compile(text, values, name, par_count, adapted, 12 if states else 11)


def compile_normal(text: str, values: dict[str, Any], name: str, par_count: int) -> tuple[int, str]:
    """Return the address of a compiled CNFSUB and '', or 0 and the reason: `compile_friction`."""
    from mbsim.plugins.adapters.normal import normal_address

    return _compile(text, values, name, par_count, normal_address, 13)


def compile_residual(
    text: str, values: dict[str, Any], name: str, par_count: int, axes: int, unknowns: int
) -> tuple[int, str]:
    """Return the address of a compiled residual and '', or 0 and the reason."""
    from mbsim.plugins.adapters.residual import residual_address

    adapted = functools.partial(residual_address, axes=axes, unknowns=unknowns)
    return _compile(text, values, name, par_count, adapted, 6)


def _compile(
    text: str,
    values: dict[str, Any],
    name: str,
    par_count: int,
    adapted: Callable[[Callable[..., Any], list[Any], int], int],
    documented: int,
) -> tuple[int, str]:
    """Return what `compile_friction` does, of a subroutine of so many documented arguments."""
    if par_count > PAR_MAX:
        return 0, f"more than {PAR_MAX} parameters"
    try:
        known = module_globals(ast.parse(text), values)
        order = check(name, known)
    except Refused as refused:
        return 0, str(refused)
    try:
        module = _module(rewritten(order, known, documented))
        callees = [getattr(module, each) for each in order[:-1]]
        with warnings.catch_warnings():
            # Numba's hints on speed are not for the user of a script
            warnings.simplefilter("ignore")
            return adapted(getattr(module, name), callees, par_count), ""
    except OSError as error:
        return 0, f"the cache folder {jit.cache_root()} cannot be written ({error})"
    except Exception as error:  # whatever Numba cannot do, Python still can
        return 0, f"does not compile: {_first_words(error)}"


#: The line of the user's script that a message of Numba's points at.
_AT = re.compile(r'mbsim_plugin_\w+\.py", line \d+:\n(?:.*\n)*?(.*)\n\s*\^')
#: An operator for which it has no whole lists: vectors are tuples in compiled code.
_WHOLE = re.compile(r"No implementation of function Function\(<built-in function \w+>\)"
                    r"[^\n]*\n\s*\n?\s*>>> \w+\([^\n]*Tuple\(")  # fmt: skip
#: Beginnings of lines that say where, not what.
_AROUND = ("Failed in", "During:", "There are", "File ", "raised from", "^", ">>>", "*", "Of which")


def _first_words(error: Exception) -> str:
    """Return the telling line of one of Numba's long messages."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    if "built-in function len" in plain:
        return "what it returns is no list of numbers"
    if "unify" in plain and "return type" in plain:
        return "branches return different kinds, as a list and a tuple: let all return a list"
    at = _AT.findall(plain)
    where = f" in {at[-1].strip()}" if at else ""
    if "tuple index out of range" in plain:
        return f"an index is beyond the last number{where}"
    if _WHOLE.search(plain):
        return f"arithmetic with a whole list, not with its numbers{where}"
    lines = [line.strip(" -") for line in plain.splitlines()]
    telling = [line for line in lines if line and not line.startswith(_AROUND)]
    # the innermost of the functions that it could not make is what the script has
    asked = [line for line in telling if line.startswith("No implementation of function")]
    words = re.sub(r"Function\(<.*?(\w+)'?( at 0x\w+)?>\)", r"\1", (asked or telling or [""])[-1])
    words = words.removesuffix(" found for signature:")
    return f"{type(error).__name__}: {words}{where}"[:200]


def _module(text: str) -> types.ModuleType:
    """Return the module of a rewritten text, from a file that its content names.

    Numba keys its cache by the file, and pickles the function by the name of its module:
    both must be the same in the next process.
    """
    digest = hashlib.sha256(text.encode()).hexdigest()[:24]
    name = f"mbsim_plugin_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    file = trusted_root() / "plugins" / f"{name}.py"
    _write(file, text)
    module = types.ModuleType(name)
    module.__file__ = str(file)
    sys.modules[name] = module
    try:
        # from the text at hand, not from the file: nobody else's edit gets in
        exec(compile(text, str(file), "exec", dont_inherit=True), module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _write(file: Path, text: str) -> None:
    """Write a file unless it is there; two processes may do so at once."""
    if file.is_file() and file.read_bytes() == text.encode():
        return
    file.parent.mkdir(mode=0o700, exist_ok=True)
    draft = file.with_suffix(f".{os.getpid()}.tmp")
    draft.write_bytes(text.encode())
    draft.replace(file)

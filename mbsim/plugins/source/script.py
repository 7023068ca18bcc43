"""A user's file of Python: read and run once, and what it defines."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import inspect
import itertools
import linecache
import marshal
import re
import sys
import traceback
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbsim.core.stored import read_regular
from mbsim.errors import ModelError
from mbsim.plugins.helpers import namespace
from mbsim.plugins.permission import check
from mbsim.plugins.source.diagnose import diagnose
from mbsim.plugins.source.shared_library import is_library

#: Names of the arguments of a friction function, in order.
CFFSUB = "id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag"
_numbers = itertools.count(1)


@dataclass(frozen=True)
class Script:
    """A user's file after it has run once: its namespace and, unless a .pyc, its text."""

    path: Path
    text: str | None
    values: dict[str, Any]

    @property
    def looks(self) -> bool:
        """Return whether it may ask for functions of the language; of a .pyc nobody knows."""
        return self.text is None or bool(re.search("py_sysfnc|py_sysary", self.text))

    def defines(self, name: str) -> bool:
        """Return whether the script has bound a name beside those it was given."""
        return name in self.values and _is_own(name, self.values[name])

    def listed(self) -> str:
        """Return the functions that the script defines, for a message."""
        functions = [name for name, value in _own(self).items() if inspect.isfunction(value)]
        return ", ".join(functions) or "no function"


Scripts = dict[Path, Script]


def _own(script: Script) -> dict[str, Any]:
    """Return what a script has bound beside the names it was given."""
    return {name: value for name, value in script.values.items() if _is_own(name, value)}


def _is_own(name: str, value: Any) -> bool:
    """Return whether a script has bound a name to that, for it was not given so."""
    given = namespace()
    return not name.startswith("__") and (name not in given or value is not given[name])


def require(script: Script, name: str, element: str, attribute: str) -> None:
    """Raise a ModelError unless a script defines a function."""
    if not script.defines(name):
        raise ModelError(
            f'{element}: {script.path} does not define {attribute}="{name}"; '
            f"it defines {script.listed()}"
        )


def _takes(function: Any, count: int) -> bool:
    """Return whether a function has so many arguments and no others, which is soon seen."""
    if type(function) is not types.FunctionType or vars(function):
        return False
    code = function.__code__
    return code.co_argcount == count and not code.co_kwonlyargcount


def user_function(
    script: Script, name: str, element: str, arguments: str = CFFSUB
) -> Callable[..., Any]:
    """Return the function of a script after a look at whether its arguments fit."""
    count = len(arguments.split(","))
    function: Callable[..., Any] = script.values[name]
    if not callable(function):
        kind = type(function).__name__
        raise ModelError(f"{element}: {name} in {script.path} is a {kind}, not a function")
    if _takes(function, count):
        return function
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # some functions written in C tell nothing
        return function
    try:
        signature.bind(*range(count))
    except TypeError as error:
        code = getattr(function, "__code__", None)
        place = f"{script.path}:{code.co_firstlineno}" if code else str(script.path)
        raise ModelError(
            f"{element}: {place}: {name}{signature} cannot be called with the {count} arguments "
            f"({arguments}): {error}"
        ) from None
    return function


def load_script(path: Path, element: str, scripts: Scripts) -> Script:
    """Return a file of Python, run at most once for one `scripts`."""
    path = path.absolute()
    check(path, element)
    if path in scripts:
        return scripts[path]
    if is_library(path):
        raise ModelError(f"{element}: {path}: a shared library is no script; name it by *_dll_name")
    if path.suffix.lower() in (".m", ".oml"):
        raise ModelError(
            f"{element}: {path}: only the laws of Force_Contact can be in the MATLAB "
            "language; use Python"
        )
    try:
        data = read_regular(path)
    except OSError as error:
        raise ModelError(f"{element}: {path}: {error.strerror or error}") from None
    text = None
    try:
        if path.suffix.lower() == ".pyc":
            code = _bytecode(data, path, element)
        else:
            text, lines = _decoded(data)
            code = _compiled(text, str(path))
    except (SyntaxError, ValueError, UnicodeDecodeError) as error:
        raise ModelError(f"{element}: {diagnose(data, str(path), error)}") from None
    if text is not None:
        # tracebacks show the lines that run, even if the file is edited meanwhile
        linecache.cache[str(path)] = (len(data), None, lines, str(path))
    scripts[path] = Script(path, text, _run(code, path, element))
    return scripts[path]


@functools.lru_cache(maxsize=256)
def _decoded(data: bytes) -> tuple[str, list[str]]:
    """Return the text of a script, whole and in lines, which nobody changes."""
    text = importlib.util.decode_source(data)
    return text, text.splitlines(True)


@functools.lru_cache(maxsize=256)
def _compiled(text: str, file: str) -> types.CodeType:
    """Return the code of a script: a process that runs a model many times compiles it once."""
    return compile(text, file, "exec", dont_inherit=True)


def _bytecode(data: bytes, path: Path, element: str) -> types.CodeType:
    if data[:4] != importlib.util.MAGIC_NUMBER:
        raise ModelError(f"{element}: {path} was compiled by another version of Python")
    try:
        code = marshal.loads(data[16:])
    except (ValueError, EOFError, TypeError):
        code = None
    if not isinstance(code, types.CodeType):
        raise ModelError(f"{element}: {path} is not compiled Python")
    return code


def _run(code: types.CodeType, path: Path, element: str) -> dict[str, Any]:
    """Return the namespace of a script after it has run."""
    module = types.ModuleType(f"mbsim_user_{path.stem}_{next(_numbers)}")
    module.__dict__.update(namespace(), __file__=str(path))
    # dataclasses look their module up, and a script may import its neighbours
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(path.parent))  # noqa: TID251
    try:
        with contextlib.redirect_stdout(sys.stderr):
            exec(code, module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == code.co_filename]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        what = traceback.format_exception_only(type(error), error)[-1].strip()
        raise ModelError(f"{element}: {place}: the script fails when it is read: {what}") from None
    finally:
        sys.path.remove(str(path.parent))  # noqa: TID251
        del sys.modules[module.__name__]
    return module.__dict__

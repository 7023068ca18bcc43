"""From a Force_Contact that names a user subroutine to a function that the run can call."""

from __future__ import annotations

import contextlib
import importlib.util
import inspect
import itertools
import linecache
import marshal
import re
import sys
import traceback
import types
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from mbsim.errors import ModelError
from mbsim.model.elements import Contact, Subroutine
from mbsim.plugins import guard
from mbsim.plugins.dependence import dependence
from mbsim.plugins.diagnose import diagnose, lint, reads_parameter
from mbsim.plugins.helpers import host, namespace
from mbsim.plugins.octave import SUFFIX, OctaveFile, read_octave, running
from mbsim.plugins.shared_library import (
    Library,
    address_of,
    choose,
    friction,
    is_library,
    read_library,
    sees_x,
)

#: Names of the arguments of a friction function, in order.
CFFSUB = "id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag"
#: Numbers that a friction function of the user may keep at most.
STATES_MAX = 64
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
        return name in _own(self)

    def listed(self) -> str:
        """Return the functions that the script defines, for a message."""
        functions = [name for name, value in _own(self).items() if inspect.isfunction(value)]
        return ", ".join(functions) or "no function"


Scripts = dict[Path, Script]
Found = TypeVar("Found", Script, Script | Library | OctaveFile)


@dataclass(frozen=True, eq=False)
class UserFriction:
    """A user's friction function, ready to be called.

    Keep it alive as long as `address` is in use: an interpreted one owns its callback, one of
    a library the memory that `hidden` points to.

    Attributes
    ----------
    address : int
        Of the C function behind `laws.abi.FRICTION_SIGNATURE`.
    par : ndarray, shape (n,)
        The values of cff_param_string; the C function reads them through its `par`.
    compiled : bool
        Whether machine code stands there; else a callback into Python.
    reason : str
        Why it stays interpreted, empty if compiled.
    uses_x : bool
        Whether its text reads the deformation `x`, or might: the host then integrates X.
    reads_x : bool
        Whether an error of X counts; not where a function without text is seen not to read it.
    source : Path
        The user's file.
    name : str
        The function in that file.
    element : int
        The Force_Contact.
    function : callable
        The user's own function object.
    looks : bool
        Whether it is interpreted and its script may ask for the state by `py_sysfnc`.
    language : str
        Python, C, Fortran or Octave.
    hidden : tuple of float
        What the C function behind `address` reads of its parameters before `par`.
    asked : tuple of str
        What an interpreted one asked for by `py_sysfnc` and `py_sysary` under iflag.
    states : int
        How many numbers it keeps: CFFSUB_STATES of its script.
    """

    address: int
    par: npt.NDArray[np.float64]
    compiled: bool
    reason: str
    uses_x: bool
    source: Path
    name: str
    element: int
    function: Callable[..., Any] | None = field(repr=False)
    keep: object = field(default=None, repr=False)
    looks: bool = False
    language: str = "Python"
    hidden: tuple[float, ...] = ()
    asked: tuple[str, ...] = ()
    reads_x: bool = True
    states: int = 0

    @property
    def how(self) -> str:
        """How it runs, in a word for the user."""
        if self.language != "Python":
            return self.language
        return "compiled" if self.compiled else "interpreted"

    @property
    def row(self) -> npt.NDArray[np.float64]:
        """The parameters as the C function behind `address` reads them."""
        return np.concatenate([self.hidden, self.par])

    def call(
        self,
        time: float,
        par: Any,
        loci: Any,
        locj: Any,
        x: Any,
        xdot: Any,
        nforce: float,
        dflag: int = 0,
        state: Any = (),
        area: float = 0.0,
    ) -> list[float]:
        """Return [Fx, Fy, Tz] of the interpreted function, and its new state if it keeps one.

        What it raises comes through. `state` may be longer than what it keeps.
        """
        assert self.function is not None
        lists = [[float(value) for value in given] for given in (par, loci, locj, x, xdot)]
        host.time, host.area = float(time), float(area)
        values, loci, locj, x, xdot = lists
        result = self.function(
            self.element, host.time, values, len(values), loci, locj, x, xdot, float(nforce),
            dflag, 0, *([[float(value) for value in state][: self.states]] if self.states else ()),
        )  # fmt: skip
        if self.states:
            return guard.force_and_state(result, self.states)
        return guard.three_numbers(result)


def load_friction(
    contact: Contact,
    plugin_files: Sequence[Path] = (),
    interpret: bool = False,
    scripts: Scripts | None = None,
    log: Callable[[str], None] | None = None,
) -> UserFriction:
    """Return the user's friction function of a contact, compiled if it can be.

    Parameters
    ----------
    contact : Contact
        A Force_Contact of cff_type USERCFF.
    plugin_files : sequence of Path
        The files named with --plugin.
    interpret : bool
        Leave it interpreted (--interpret-plugins).
    scripts : dict, optional
        Files that have run already; pass one dict for all contacts of a run, so that a
        script that serves several contacts runs once and keeps one set of globals.
    log : callable, optional
        Takes the warnings, one line each; `host.log` if left out.

    Returns
    -------
    UserFriction

    Raises
    ------
    ModelError
        If the file or the function cannot be used; the message says what to change.
    """
    say = log or host.log
    element, name = f"Force_Contact[{contact.id}]", contact.cff.fnc_name or "CFFSUB"
    script = find_subroutine(contact, plugin_files, {} if scripts is None else scripts)
    if isinstance(script, Library):
        return _from_library(script, contact, name, say)
    if isinstance(script, OctaveFile):
        return _from_octave(script, contact, name, say)
    states = _states(script, contact)
    function = user_function(script, name, element, CFFSUB + ", state" * (states > 0))
    par = np.array(contact.cff.par, dtype=np.float64)
    uses_x = True  # a .pyc has no text to look at
    if script.text is not None:
        uses_x = reads_parameter(script.text, name, 6)
        for warning in lint(script.text, name, states > 0):
            say(f"{element}: {script.path}: warning: {warning}")

    def user(
        address: int, reason: str, keep: object = None, asked: Sequence[str] = ()
    ) -> UserFriction:
        return UserFriction(
            address=address,
            par=par,
            compiled=not reason,
            reason=reason,
            uses_x=uses_x,
            source=script.path,
            name=name,
            element=contact.id,
            function=function,
            keep=keep,
            looks=bool(reason) and script.looks,
            asked=tuple(asked),
            states=states,
        )

    address, reason = 0, "--interpret-plugins"
    if not interpret:
        address, reason = _compiled(script, name, par, user)
        if reason:
            say(f"{element}: {name} of {script.path} stays interpreted: {reason}")
    if not reason:
        return user(address, "")
    address, keep = guard.callback(function, name, str(script.path), len(par), states)
    # compiled functions only compute: whether they are called once more nobody can see
    asked, why = dependence(function, friction_arguments(contact, states))
    if why:
        say(f"{element}: {name} of {script.path}: note: its call with iflag 1 fails: {why}")
    return user(address, reason, keep, asked)


def friction_arguments(contact: Contact, states: int = 0) -> list[Any]:
    """Return the arguments of the one call of a contact's CFFSUB with iflag true."""
    par, zeros = [float(value) for value in contact.cff.par], [[0.0] * 3 for _ in range(4)]
    state = [[0.0] * states] if states else []
    return [contact.id, 0.0, par, len(par), *zeros, 0.0, 0, 1, *state]


def check_libraries(contacts: Iterable[Contact]) -> None:
    """Look for the functions of the libraries that contacts name; none of them is called.

    Raises
    ------
    ModelError
        With a line for each that is not there, or whose language is not clear.
    """
    faults = []
    for contact in contacts:
        for prefix, user in (("cff", contact.cff), ("cnf", contact.cnf)):
            if not user.dll_name:
                continue
            try:
                element = f"Force_Contact[{contact.id}]"
                library = find_source(user, user.fnc_name, element, prefix)
                assert isinstance(library, Library)
                choose(library, user.fnc_name, prefix, user.language)
            except ModelError as error:
                faults.append(str(error))
    if faults:
        raise ModelError("\n".join(faults))


def _from_library(
    library: Library, contact: Contact, name: str, say: Callable[[str], None]
) -> UserFriction:
    """Return the friction function of a shared library."""
    par = np.array(contact.cff.par, dtype=np.float64)
    language, symbol = choose(library, name, "cff", contact.cff.language)
    at = address_of(library, symbol, say)
    address, hidden, keep = friction(at, language, contact.id, par)
    reads_x = sees_x(address, contact.id, np.concatenate([[hidden], par]), contact.cff.par)
    return UserFriction(
        address=address,
        par=par,
        compiled=True,
        reason="",
        uses_x=True,  # nobody knows what machine code reads
        source=library.path,
        name=name,
        element=contact.id,
        function=None,
        keep=keep,
        language=language,
        hidden=(hidden,),
        reads_x=reads_x,
    )


def _from_octave(
    file: OctaveFile, contact: Contact, name: str, say: Callable[[str], None]
) -> UserFriction:
    """Return a friction function in the MATLAB language."""
    element, par = f"Force_Contact[{contact.id}]", np.array(contact.cff.par, dtype=np.float64)
    octave = running(element)
    function = octave.add(file, CFFSUB, len(par), element)
    _, why = dependence(function, friction_arguments(contact))
    if why:
        say(f"{element}: {name} of {file.path}: note: its call with iflag 1 fails: {why}")
    address, keep = guard.callback(function, name, str(file.path), len(par))
    reads_x = sees_x(address, contact.id, par, contact.cff.par)
    guard.failure.clear()
    return UserFriction(
        address=address,
        par=par,
        compiled=False,
        reason="",
        uses_x=True,
        source=file.path,
        name=name,
        element=contact.id,
        function=function,
        keep=(keep, octave),
        language="Octave",
        reads_x=reads_x,
    )


def _states(script: Script, contact: Contact) -> int:
    """Return how many numbers the friction functions of a script keep, 0 for none."""
    count = script.values.get("CFFSUB_STATES", 0)
    element = f"Force_Contact[{contact.id}]"
    if type(count) is not int or not 0 <= count <= STATES_MAX:
        raise ModelError(
            f"{element}: {script.path}: CFFSUB_STATES = {count!r}: a whole number from 0 to "
            f"{STATES_MAX} is allowed"
        )
    if count and contact.cff_type != "USERCFF":
        raise ModelError(
            f'{element}: {script.path} sets CFFSUB_STATES, which goes with cff_type="USERCFF" '
            f"only: {contact.cff_type} has its own memory"
        )
    return count


def _compiled(
    script: Script,
    name: str,
    par: npt.NDArray[np.float64],
    user: Callable[[int, str], UserFriction],
) -> tuple[int, str]:
    """Return the address of compiled code that has passed the probes, or 0 and the reason."""
    if script.text is None:
        return 0, "a .pyc has no source"
    # here and not above: `import mbsim.plugins` must not load Numba
    from mbsim.laws.abi import DFLAG, FRICTION_INPUTS
    from mbsim.plugins.compiled import compile_friction
    from mbsim.plugins.probe import disagreement

    twin = user(0, "probe")
    address, reason = compile_friction(script.text, script.values, name, len(par), twin.states)
    if reason:
        return 0, reason

    def call(a: list[float]) -> list[float]:
        given = a[13:16], a[16:19], a[2:5], a[5:8], a[10], int(a[DFLAG] + 0.5)
        return twin.call(a[0], par, *given, state=a[FRICTION_INPUTS:], area=a[11])

    # a place that the text does not read needs no probe
    read = [reads_parameter(script.text, name, position) for position in (4, 5, 6, 9)]
    reason = disagreement(
        address, call, par, script.text, script.values, twin.element, read, twin.states
    )
    return (0, reason) if reason else (address, "")


def find_subroutine(
    contact: Contact, plugin_files: Sequence[Path] = (), scripts: Scripts | None = None
) -> Script | Library | OctaveFile:
    """Return what defines the friction function of a contact: a script, run once, or a library.

    `cff_dll_name` and `script_name` in the deck come before `plugin_files`; two of these that
    define the function are an error.

    Raises
    ------
    ModelError
        If no file is named, or none that is named can be used.
    """
    element = f"Force_Contact[{contact.id}]"
    name = contact.cff.fnc_name or "CFFSUB"
    return find_source(contact.cff, name, element, "cff", plugin_files, scripts)


def find_source(
    user: Subroutine,
    name: str,
    element: str,
    prefix: str,
    plugin_files: Sequence[Path] = (),
    scripts: Scripts | None = None,
) -> Script | Library | OctaveFile:
    """Return the script or library that defines function `name` of a contact."""
    scripts = {} if scripts is None else scripts
    if user.dll_name.strip().upper() not in ("", "NULL"):
        place = f"{user.source.file}:{user.source.line}: " if user.source.file else ""
        return read_library(Path(user.dll_name), place + element)
    in_matlab = user.interpreter.upper() in ("MATLAB", "OCTAVE")
    if user.script_name and (in_matlab or Path(user.script_name).suffix.lower() == SUFFIX):
        return read_octave(Path(user.script_name), name, element)
    files = list(dict.fromkeys(Path(file).absolute() for file in plugin_files))
    if in_matlab and not any(file.suffix.lower() == SUFFIX for file in files):
        raise ModelError(
            f'{element}: interpreter="{user.interpreter}" names no .m file; name {name}.m by '
            f"script_name, or with --plugin {name}.m"
        )
    if user.script_name or not any(is_library(f) or f.suffix.lower() == SUFFIX for f in files):
        return find_script(user, name, element, prefix, files, scripts)
    loaded = [_any_kind(file, element, scripts) for file in files]
    return _only_one(loaded, name, element, f"{prefix}_fnc_name")


def _any_kind(file: Path, element: str, scripts: Scripts) -> Script | Library | OctaveFile:
    """Return a --plugin file."""
    if is_library(file):
        return read_library(file, element)
    if file.suffix.lower() == SUFFIX:
        return read_octave(file, file.stem, element)
    return _load(file, element, scripts)


def _only_one(loaded: Sequence[Found], name: str, element: str, attribute: str) -> Found:
    """Return the one of several files that defines a function."""
    found = [source for source in loaded if source.defines(name)]
    if len(found) > 1:
        both = ", ".join(str(source.path) for source in found)
        raise ModelError(f"{element}: {name} is defined twice: {both}")
    if not found:
        defined = "; ".join(f"{source.path} defines {source.listed()}" for source in loaded)
        raise ModelError(f'{element}: no plugin file defines {attribute}="{name}": {defined}')
    return found[0]


def find_script(
    user: Subroutine,
    name: str,
    element: str,
    prefix: str,
    plugin_files: Sequence[Path] = (),
    scripts: Scripts | None = None,
) -> Script:
    """Return the script that defines function `name` of an element; see `find_subroutine`.

    `element` is how messages name it, `prefix` (cff, usrsub) what its attributes begin with,
    or ROUTINE of an Adams deck.
    """
    scripts = {} if scripts is None else scripts
    attribute = prefix if prefix == "ROUTINE" else f"{prefix}_fnc_name"
    if user.interpreter and user.interpreter.upper() != "PYTHON":
        raise ModelError(
            f'{element}: interpreter="{user.interpreter}": only the laws of Force_Contact can be '
            "in the MATLAB language; use Python"
        )
    if user.script_name:
        script = _load(Path(user.script_name), element, scripts)
        _require(script, name, element, attribute)
        return script

    dll_name = user.dll_name.strip()
    # shared libraries and the MATLAB language are for contacts
    files = [file for file in dict.fromkeys(map(Path.absolute, map(Path, plugin_files)))
             if not is_library(file) and file.suffix.lower() != SUFFIX]  # fmt: skip
    if not files:
        said = f'{prefix}_dll_name="{dll_name}"' if dll_name else "no script_name"
        said = f"no FILE.py::{name}" if prefix == "ROUTINE" else said
        raise ModelError(
            f'{element}: {attribute}="{name}" names no file ({said}); '
            "name one with --plugin FILE.py"
        )
    loaded = [_load(file, element, scripts) for file in files]
    return _only_one(loaded, name, element, attribute)


def _own(script: Script) -> dict[str, Any]:
    """Return what a script has bound beside the names it was given."""
    given = namespace()
    return {
        name: value
        for name, value in script.values.items()
        if not name.startswith("__") and (name not in given or value is not given[name])
    }


def _require(script: Script, name: str, element: str, attribute: str) -> None:
    if not script.defines(name):
        raise ModelError(
            f'{element}: {script.path} does not define {attribute}="{name}"; '
            f"it defines {script.listed()}"
        )


def user_function(
    script: Script, name: str, element: str, arguments: str = CFFSUB
) -> Callable[..., Any]:
    """Return the function of a script after a look at whether its arguments fit."""
    count = len(arguments.split(","))
    function = script.values[name]
    if not callable(function):
        kind = type(function).__name__
        raise ModelError(f"{element}: {name} in {script.path} is a {kind}, not a function")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # some functions written in C tell nothing
        return function  # type: ignore[no-any-return]
    try:
        signature.bind(*range(count))
    except TypeError as error:
        code = getattr(function, "__code__", None)
        place = f"{script.path}:{code.co_firstlineno}" if code else str(script.path)
        raise ModelError(
            f"{element}: {place}: {name}{signature} cannot be called with the {count} arguments "
            f"({arguments}): {error}"
        ) from None
    return function  # type: ignore[no-any-return]


def _load(path: Path, element: str, scripts: Scripts) -> Script:
    """Return a file of Python, run at most once for one `scripts`."""
    path = path.absolute()
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
        data = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{element}: {path}: {error.strerror or error}") from None
    text = None
    try:
        if path.suffix.lower() == ".pyc":
            code = _bytecode(data, path, element)
        else:
            text = importlib.util.decode_source(data)
            code = compile(text, str(path), "exec", dont_inherit=True)
    except (SyntaxError, ValueError, UnicodeDecodeError) as error:
        raise ModelError(f"{element}: {diagnose(data, str(path), error)}") from None
    if text is not None:
        # tracebacks show the lines that run, even if the file is edited meanwhile
        linecache.cache[str(path)] = (len(data), None, text.splitlines(True), str(path))
    scripts[path] = Script(path, text, _run(code, path, element))
    return scripts[path]


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

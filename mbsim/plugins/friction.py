"""From a Force_Contact that names a user subroutine to a function that the run can call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.errors import ModelError
from mbsim.model.elements import Contact
from mbsim.plugins import guard
from mbsim.plugins.dependence import dependence
from mbsim.plugins.helpers import host
from mbsim.plugins.source.diagnose import lint, reads_parameter
from mbsim.plugins.source.find import find_subroutine
from mbsim.plugins.source.octave import OctaveFile, running
from mbsim.plugins.source.script import CFFSUB, Script, Scripts, user_function
from mbsim.plugins.source.shared_library import Library, address_of, choose, friction, sees_x
from mbsim.plugins.types import UserFriction

#: Why compiled code is not taken, or "", by all that its probes depend on: the text, the numbers
#: that its module holds, function, parameters, contact and states. A process that runs a model many
#: times asks once.
_verdicts: dict[tuple[Any, ...], tuple[int, str]] = {}
#: Numbers that a friction function of the user may keep at most.
STATES_MAX = 64
#: Verdicts that are kept.
VERDICTS_MOST = 4096


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
    uses_x = reads_time = True  # a .pyc has no text to look at
    if script.text is not None:
        uses_x = reads_parameter(script.text, name, 6)
        reads_time = reads_parameter(script.text, name, 1)
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
            reads_time=reads_time,
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
    numbers = tuple((k, repr(v)) for k, v in script.values.items() if isinstance(v, int | float))
    twin = user(0, "probe")
    key = script.text, numbers, name, par.tobytes(), twin.element, twin.states
    if key not in _verdicts:
        if len(_verdicts) >= VERDICTS_MOST:
            _verdicts.clear()
        _verdicts[key] = _probed(script, script.text, name, par, twin)
    return _verdicts[key]


def _probed(
    script: Script, text: str, name: str, par: npt.NDArray[np.float64], twin: UserFriction
) -> tuple[int, str]:
    """Compile a function and hold it against its `twin`, which is interpreted: as `_compiled`."""
    # here and not above: `import mbsim.plugins` must not load Numba
    from mbsim.laws.abi import DFLAG, FRICTION_INPUTS
    from mbsim.plugins.compile.compiled import compile_friction
    from mbsim.plugins.compile.probe import disagreement

    address, reason = compile_friction(text, script.values, name, len(par), twin.states)
    if reason:
        return 0, reason

    def call(a: list[float]) -> list[float]:
        given = a[13:16], a[16:19], a[2:5], a[5:8], a[10], int(a[DFLAG] + 0.5)
        return twin.call(a[0], par, *given, state=a[FRICTION_INPUTS:], area=a[11])

    # a place that the text does not read needs no probe
    read = [reads_parameter(text, name, position) for position in (4, 5, 6, 9)]
    reason = disagreement(address, call, par, text, script.values, twin.element, read, twin.states)
    return (0, reason) if reason else (address, "")

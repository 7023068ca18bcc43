"""CNFSUB: the normal force of a Force_Contact by a user's function, in Python, C or Fortran."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from mbsim.errors import PluginError
from mbsim.laws import user_normal as at
from mbsim.model.elements import Contact
from mbsim.plugins import guard
from mbsim.plugins.dependence import dependence
from mbsim.plugins.helpers import host
from mbsim.plugins.permission import watched
from mbsim.plugins.source.diagnose import reads_parameter
from mbsim.plugins.source.find import find_source
from mbsim.plugins.source.octave import OctaveFile, running
from mbsim.plugins.source.script import Script, Scripts, user_function
from mbsim.plugins.source.shared_library import FORTRAN, Library, address_of, choose
from mbsim.plugins.types import UserNormal

#: Names of the arguments, in order.
CNFSUB = "id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag"
_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_double, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p
)


def normal_arguments(contact: Contact) -> list[Any]:
    """Return the arguments of the one call of a contact's CNFSUB with iflag true."""
    par, zeros = [float(value) for value in contact.cnf.par], [[0.0] * 3 for _ in range(4)]
    return [contact.id, 0.0, par, len(par), *zeros, 0.0, 0.0, 0.0, 0, 1]


def load_normal(
    contact: Contact,
    plugin_files: Sequence[Path],
    interpret: bool,
    scripts: Scripts,
    log: Callable[[str], None] | None = None,
) -> UserNormal:
    """Return the user's normal law of a contact, compiled if it can be.

    The arguments are those of `friction.load_friction`, and so is what is raised.
    """
    say = log or host.log
    element, name = f"Force_Contact[{contact.id}]", contact.cnf.fnc_name
    source = find_source(contact.cnf, name, element, "cnf", plugin_files, scripts)
    inputs = np.zeros(at.NORMAL_INPUTS)
    inputs[at.MODE], inputs[at.ID] = at.EXPLORE, contact.id
    made = UserNormal(
        address=0,
        par=np.array(contact.cnf.par, dtype=np.float64),
        inputs=inputs,
        hidden=(float(inputs.ctypes.data),),
        source=source.path,
        name=name,
        element=contact.id,
    )
    if isinstance(source, Library):
        return _from_library(made, source, contact.cnf.language, say)
    if isinstance(source, OctaveFile):
        octave = running(element)
        function = octave.add(source, CNFSUB, len(made.par), element)
        made = replace(made, function=function, language="Octave", compiled=False, keep=octave)
    else:
        reads_time = source.text is None or reads_parameter(source.text, name, 1)
        function = user_function(source, name, element, CNFSUB)
        made = replace(made, function=function, reads_time=reads_time)
        address, reason = (0, "--interpret-plugins") if interpret else _compiled(made, source)
        if not reason:
            return replace(made, address=address)
        say(f"{element}: {name} of {source.path} stays interpreted: {reason}")
        made = replace(made, compiled=False, reason=reason, looks=source.looks)
    assert made.function is not None
    inputs[at.PYTHON] = 1.0
    asked, why = dependence(made.function, normal_arguments(contact))
    if why:
        say(f"{element}: {name} of {source.path}: note: its call with iflag 1 fails: {why}")
    made = replace(made, asked=tuple(asked))
    address, keep = _callback(made)
    return replace(made, address=address, keep=(keep, made.keep))


def _from_library(
    made: UserNormal, library: Library, language: str, say: Callable[[str], None]
) -> UserNormal:
    """Return the normal law of a shared library; its function has been called with iflag 1."""
    from mbsim.core import jit
    from mbsim.core.address import pack
    from mbsim.laws.abi import NORMAL_SIGNATURE
    from mbsim.plugins.adapters.normal import NormalCall, call_c, call_fortran

    spoken, symbol = choose(library, made.name, "cnf", language)
    call = NormalCall(
        address=np.array([address_of(library, symbol, say)], dtype=np.int64),
        whole=np.array([made.element, len(made.par), 0, 1], dtype=np.int32),
        par=made.par.copy(),
        inputs=made.inputs,
        gap=np.zeros(4),
        result=np.zeros(8),
    )
    id, npar, dflag, iflag = (call.whole[k:].ctypes.data for k in range(4))
    vectors = [made.inputs[k:].ctypes.data for k in (at.LOCI, at.NI, at.LOCJ, at.NJ)]
    gaps = [call.gap[k:].ctypes.data for k in range(4 if spoken == FORTRAN else 3)]
    given = [id, made.inputs[at.TIME :].ctypes.data, call.par.ctypes.data, npar, *vectors, *gaps]
    given += [dflag, iflag, call.result.ctypes.data]
    ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(given))(int(call.address[0]))(*given)
    table = pack(call)
    return replace(
        made,
        address=jit.address(call_fortran if spoken == FORTRAN else call_c, NORMAL_SIGNATURE),
        hidden=(float(table.ctypes.data),),
        language=spoken,
        keep=(call, table),
    )


def _compiled(made: UserNormal, script: Script) -> tuple[int, str]:
    """Return the address of compiled code that has passed the probes, or 0 and the reason."""
    if script.text is None:
        return 0, "a .pyc has no source"
    from mbsim.plugins.compile.compiled import compile_normal
    from mbsim.plugins.compile.probe import normal_disagreement

    address, reason = compile_normal(script.text, script.values, made.name, len(made.par))
    if reason:
        return 0, reason
    read = [reads_parameter(script.text, made.name, k) for k in (4, 5, 6, 7)]
    before = made.inputs.copy()
    reason = normal_disagreement(address, made, script.text, script.values, read)
    made.inputs[:] = before
    return (0, reason) if reason else (address, "")


def _callback(made: UserNormal) -> tuple[int, object]:
    """Return the address of the interpreted function as a normal law, and what keeps it alive."""
    from mbsim.core.codes import Code

    out_at, inputs = guard.Views(3), made.inputs.data
    own = len(made.hidden)
    par_at = guard.Views(own + len(made.par))
    call = watched(made.call, f"Force_Contact[{made.element}]: {made.name} ({made.source})")

    def guarded(depth: float, rate: float, par: int, out: int) -> int:
        outer = host.state
        try:
            results, given = out_at[out], par_at[par].tolist()[own:]
            at.begin(results, depth)
            if host.seen is not None:
                host.state = (host.seen[0], inputs[at.TIME], host.seen[1])
            for k in range(at.questions(inputs, depth)):
                at.keep(results, k, depth, call(*at.question(k, depth, rate), given))
            return 0
        except guard.PassedOn:
            return Code.RAISED_INTERPRETED
        except BaseException as error:
            title, source = f"Force_Contact[{made.element}]", str(made.source)
            guard.failure.store(error, title, inputs[at.TIME], made.name, source)
            return guard.code_of(error)
        finally:
            host.state = outer

    entry = _FUNCTION(guarded)
    return int(ctypes.cast(entry, ctypes.c_void_p).value or 0), entry


def reproduce_normal(user: UserNormal) -> NoReturn:
    """Raise why a normal law failed where its inputs say that it was asked last.

    Raises
    ------
    PluginError
        Always.
    """
    depth, rate, time = (float(user.inputs[k]) for k in (at.DEPTH, at.RATE, at.TIME))
    title = f"Force_Contact[{user.element}]: {user.name}"
    where = f"at time {time:.12g}, gap {-depth:.9g}, gapdot {-rate:.9g}"
    if user.function is None:
        raise PluginError(
            f"{title} returned no finite number {where} ({user.source}); what is unset is nan"
        )
    try:
        user.inputs[at.MODE] = at.EVALUATE
        force = user.call(depth, rate)
    except BaseException as error:
        guard.failure.clear()
        element = f"Force_Contact[{user.element}]"
        guard.failure.store(error, element, time, user.name, str(user.source))
        guard.raise_failure()
    raise PluginError(
        f"{title} ({user.source}) failed {where} when compiled, but gives {force} when "
        "interpreted; run it with --interpret-plugins"
    )

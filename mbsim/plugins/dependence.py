"""The call with iflag true: which functions a subroutine asks for, before the run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from mbsim.plugins.helpers import host


def dependence(function: Callable[..., Any], arguments: Sequence[Any]) -> tuple[list[str], str]:
    """Call a subroutine and return what it asks for meanwhile, and what it raises, if anything.

    There is no state yet: all that is asked for is 0, and what the function returns is not
    looked at. Many functions do not look at iflag and may fail at zeros: that is no fault, a
    function that fails at what it is called with later is found then.

    Parameters
    ----------
    function : callable
    arguments : sequence
        With iflag 1 at its place.

    Returns
    -------
    list of str
        ``DX 20 10`` for ``py_sysfnc("DX", [20, 10])``, each once.
    str
        Kind and text of an exception, or empty.
    """
    outer, host.asked, host.time = host.asked, [], 0.0
    why = ""
    try:
        function(*arguments)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        why = f"{type(error).__name__}: {error}"
    finally:
        found, host.asked = host.asked, outer
    return list(dict.fromkeys(found)), why

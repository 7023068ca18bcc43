"""User subroutines: a script named by the user, run, compiled where it can be, and guarded.

`load_friction` turns the USERCFF of a contact into a C function behind the friction
signature of `laws.abi`; `raise_failure` and `reproduce` turn its failure codes into a
`PluginError` that shows the user's own lines. Read `friction` first, then `source.find`.
Names are imported at their first use: every run asks `permission`, few have users' code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsim.plugins.friction import load_friction
    from mbsim.plugins.guard import failure, raise_failure, reproduce
    from mbsim.plugins.helpers import host
    from mbsim.plugins.source.diagnose import diagnose, lint
    from mbsim.plugins.source.find import check_libraries, find_subroutine
    from mbsim.plugins.types import UserFriction

__all__ = [
    "UserFriction",
    "check_libraries",
    "diagnose",
    "failure",
    "find_subroutine",
    "host",
    "lint",
    "load_friction",
    "raise_failure",
    "reproduce",
]

#: Module of every public name.
_HOMES = {
    "UserFriction": "types",
    "check_libraries": "source.find",
    "diagnose": "source.diagnose",
    "failure": "guard",
    "find_subroutine": "source.find",
    "host": "helpers",
    "lint": "source.diagnose",
    "load_friction": "friction",
    "raise_failure": "guard",
    "reproduce": "guard",
}


def __getattr__(name: str) -> Any:
    """Import a public name from its home (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value

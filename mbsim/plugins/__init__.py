"""User subroutines: a script named by the user, run, compiled where it can be, and guarded.

`load_friction` turns the USERCFF of a contact into a C function behind the friction
signature of `laws.abi`; `raise_failure` and `reproduce` turn its failure codes into a
`PluginError` that shows the user's own lines. Read `friction` first, then `source.find`.
"""

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

"""CONTACTPOST: a user's function that looks at a contact's results at every output time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mbsim.model.elements import Contact, Subroutine
from mbsim.plugins import guard
from mbsim.plugins.helpers import Pair, host
from mbsim.plugins.permission import watched
from mbsim.plugins.source.find import find_either
from mbsim.plugins.source.native import asks, native
from mbsim.plugins.source.script import Scripts, user_function
from mbsim.plugins.source.shared_library import Library

#: Names of the arguments, in order.
CONTACTPOST = "id, i_gra_id, j_gra_id, time, par, npar, iflag, endflg"


@dataclass(frozen=True, eq=False)
class ContactPost:
    """A user's CONTACTPOST, ready to be called.

    Attributes
    ----------
    contact : Contact
    function : callable
    source : Path
        The user's file.
    user : Subroutine
        What the deck says of it.
    """

    contact: Contact
    function: Callable[..., Any] = field(repr=False)
    source: Path
    user: Subroutine

    def call(self, pair: Pair, time: float, iflag: int = 0, endflg: int = 0) -> None:
        """Call the function for graphics I and J of a pair.

        Raises
        ------
        PluginError
            If the function does.
        """
        user, outer = self.user, host.time
        par, host.time = [float(value) for value in user.par], time
        function = watched(self.function, f"Force_Contact[{self.contact.id}]: {user.fnc_name}")
        try:
            function(self.contact.id, *pair, time, par, len(par), iflag, endflg)
        except BaseException as error:
            guard.failure.clear()
            title = f"Force_Contact[{self.contact.id}]"
            guard.failure.store(error, title, time, user.fnc_name, str(self.source))
            guard.raise_failure()
        finally:
            host.time = outer


def load_post(contact: Contact, plugin_files: Sequence[Path], scripts: Scripts) -> ContactPost:
    """Return the CONTACTPOST of a contact, after its one call with iflag true.

    Raises
    ------
    ModelError
        If its file or function cannot be used.
    PluginError
        If the call fails.
    """
    assert contact.cpost is not None
    element, name = f"Force_Contact[{contact.id}]", contact.cpost.fnc_name
    script = find_either(contact.cpost, name, element, "cpost", plugin_files, scripts)
    if isinstance(script, Library):
        asks(script)
        function, _ = native(script, name, "cpost", contact.cpost.language, 0)
    else:
        function = user_function(script, name, element, CONTACTPOST)
    post = ContactPost(contact, function, script.path, contact.cpost)
    host.shown.clear()
    post.call((contact.i_graphics_id[0], contact.j_graphics_id[0]), 0.0, iflag=1)
    return post

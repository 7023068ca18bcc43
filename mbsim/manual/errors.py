"""Which pages of the manual tell more about an error: those of the elements that it names."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mbsim.errors import DeckError, MbsimError, PluginError, SolverError, UnknownSignal
from mbsim.manual.book import PAGES, named

#: What is told of errors that name no element with a page, by class: the file of a page.
_BY_CLASS: dict[type[MbsimError], str] = {
    SolverError: "start/questions",
}
#: What is told of an option that a message begins with, and of all errors of a command, as there.
_BY_OPTION = {"--resume": ("reference/results/what-happens-when", "reference/commands/run")}
_BY_COMMAND = {"request": ("reference/commands/request",)}
_SUBROUTINE = re.compile(r"\b(CFFSUB|CNFSUB|SFOSUB|CONTACTPOST)\b", re.IGNORECASE)
_STATEMENT = re.compile(r"\b([A-Z][A-Za-z]+_[A-Z][A-Za-z]+|Simulate|Stop)\b")
#: Elements of Adams decks, which have no underscore: `PART/2`, `SFORCE[3]`.
_ADAMS = re.compile(r"\.adm:\d+: ", re.IGNORECASE)


def about(error: type[MbsimError], texts: Sequence[str], command: str = "") -> list[str]:
    """Return names of pages, without repetition.

    Parameters
    ----------
    error : type
        Class of the error.
    texts : sequence of str
        What it says, or the elements that its faults name, behind ``FILE:LINE: ``.
    command : str
        The subcommand that fails, where it is known.

    Returns
    -------
    list of str
        Topics of `mbsim manual`; empty where no page tells more.
    """
    told = [
        page
        for option, pages in _BY_OPTION.items()
        for page in pages
        if any(text.startswith(option) for text in texts)
    ]
    if not told and not issubclass(error, DeckError):
        told = list(_BY_COMMAND.get(command, ()))
    if not told and issubclass(error, PluginError):
        subroutines = [name.lower() for text in texts for name in _SUBROUTINE.findall(text)]
        told = [f"reference/subroutines/{name}" for name in subroutines or ("index",)]
    if not told and any(_ADAMS.search(text) for text in texts):
        told = ["reference/adams"]
    if not told and not issubclass(error, UnknownSignal):
        names = [name.lower() for text in texts for name in _STATEMENT.findall(text)]
        told = [f"reference/statements/{name}" for name in names]
    there = [page for page in told if (PAGES / f"{page}.md").is_file()]
    page = _BY_CLASS.get(error, "")
    if not there and page and (PAGES / f"{page}.md").is_file():
        there = [page]
    return list(dict.fromkeys(map(_topic, there)))


def _topic(page: str) -> str:
    """Return the shortest name that stands for a page alone."""
    short = page.removesuffix("/index").rsplit("/", 1)[-1]
    return short if len(named(short)) == 1 else page

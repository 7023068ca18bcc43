"""Which pages of the manual tell more about an error: those of the elements that it names."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mbsim.errors import MbsimError, PluginError, SolverError
from mbsim.manual.book import PAGES

#: What is told of errors that name no element with a page, by class: the file of a page.
_BY_CLASS: dict[type[MbsimError], str] = {
    SolverError: "start/questions",
    PluginError: "reference/subroutines/index",
}
_STATEMENT = re.compile(r"\b([A-Z][A-Za-z]+_[A-Z][A-Za-z]+|Simulate|Stop)\b")
#: Elements of Adams decks, which have no underscore: `PART/2`, `SFORCE[3]`.
_ADAMS = re.compile(r"\.adm:\d+: ")


def about(error: type[MbsimError], texts: Sequence[str]) -> list[str]:
    """Return names of pages, without repetition.

    Parameters
    ----------
    error : type
        Class of the error.
    texts : sequence of str
        What it says, or the elements that its faults name.

    Returns
    -------
    list of str
        Topics of `mbsim manual`; empty where no page tells more.
    """
    names = [name.lower() for text in texts for name in _STATEMENT.findall(text)]
    found = [name for name in names if (PAGES / f"reference/statements/{name}.md").is_file()]
    if not found and any(_ADAMS.search(text) for text in texts):
        found = ["adams"] if (PAGES / "reference/adams.md").is_file() else []
    page = _BY_CLASS.get(error, "")
    if not found and page and (PAGES / f"{page}.md").is_file():
        found = [page.removesuffix("/index").rsplit("/", 1)[-1]]
    return list(dict.fromkeys(found))

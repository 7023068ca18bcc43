"""Every command and snippet of the manual runs, and prints what the page shows."""

from __future__ import annotations

import pytest

from helpers.snippets import Folder, agrees, as_if_warm, blocks
from mbsim.manual.book import pages

_RUN = [name for name, page in pages().items() if any(b.runs for b in blocks(page))]
_SLOW = [name for name in _RUN if any(b.runs and b.slow for b in blocks(pages()[name]))]
_QUICK = [name for name in _RUN if any(b.runs and not b.slow for b in blocks(pages()[name]))]


@pytest.mark.parametrize("name", _QUICK)
def test_what_a_page_asks_to_run(name, tmp_path):
    Folder(tmp_path).run(pages()[name], slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", _SLOW)
def test_what_a_page_asks_to_run_and_wait_for(name, tmp_path):
    Folder(tmp_path).run(pages()[name], slow=True)


def test_a_cold_run_says_the_same_but_for_compiling():
    cold = (
        "mbsim: compiling what this model needs (...)\nmbsim: compiling: 9 functions are left\n"
        "finished\n11 steps, 2 rejected, 28.89 s (23.2 s of it compiling)\n\n"
    )
    assert as_if_warm(cold) == ["finished", "11 steps, 2 rejected, 28.89 s"]


def test_dots_stand_for_anything():
    assert agrees(["a 1.5 in ... s", "...", "end"], ["a 1.5 in 0.3 s", "x", "y", "end"])
    assert agrees(["...", "end"], ["end"])
    assert not agrees(["a 1.5"], ["a 1.6"])
    assert not agrees(["a"], ["a", "b"])

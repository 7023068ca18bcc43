"""Every command and snippet of the manual runs, and prints what the page shows."""

from __future__ import annotations

import shlex
import subprocess
import sys

import pytest

from helpers.snippets import (
    ROOT,
    Folder,
    agrees,
    as_if_warm,
    blocks,
    commands,
    comments,
    nearly,
)
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


def test_what_comments_say_is_what_is_printed():
    assert comments(["# a", "print(1)  # 1 m", "x = 2  # two", "# end"]) == ["1 m", "end"]
    for shown, printed in (
        ("1e-03: 1e-04 m, 1628 evaluations", "1e-03: 2e-04 m, 1640 evaluations"),
        ("2e-17 m in 100 s", "0e+00 m in 100 s"),
        ("4.582523e-04 m = (m g/k)^(2/3)", "4.582524e-04 m"),
        ("DOPRI5    95710 steps", "DOPRI5   101000 steps"),
    ):
        assert nearly(shown, printed)
    for shown, printed in (
        ("1628 evaluations", "2100 evaluations"),
        ("1e-04 m", "1e-05 m"),
        ("1e-04 m", "1e-04 mm"),
        ("4.58e-04 m", "9.16e-04 m"),
    ):
        assert not nearly(shown, printed)


def test_dots_stand_for_anything():
    assert agrees(["a 1.5 in ... s", "...", "end"], ["a 1.5 in 0.3 s", "x", "y", "end"])
    assert agrees(["...", "end"], ["end"])
    assert not agrees(["a 1.5"], ["a 1.6"])
    assert not agrees(["a"], ["a", "b"])


def _asked_of_pytest():
    """Yield page and line, paths and words of -k of each command of pytest that no page runs."""
    for name, page in pages().items():
        for block in blocks(page):
            if block.kind != "console" or block.runs:
                continue
            for command in commands(block):
                words = shlex.split(command.text)
                if words[:3] != ["python", "-m", "pytest"]:
                    continue
                paths = [word for word in words if word.startswith("tests")]
                chosen = words[words.index("-k") + 1] if "-k" in words else ""
                if paths:
                    yield f"{name}.md:{block.line}", paths, chosen.split(" or ")


@pytest.mark.slow
def test_commands_that_no_page_runs_choose_tests():
    asked = list(_asked_of_pytest())
    assert len(asked) > 20
    files = sorted({path for _, paths, _ in asked for path in paths})
    collect = ["-o", "addopts=", "--collect-only", "-q", "-p", "no:cacheprovider", *files]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *collect],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:]
    ids = [line for line in done.stdout.splitlines() if "::" in line]
    for where, paths, chosen in asked:
        for word in chosen:
            found = [
                each
                for each in ids
                if each.startswith(tuple(paths)) and word.lower() in each.lower()
            ]
            assert found, f"{where}: {paths} {word}"

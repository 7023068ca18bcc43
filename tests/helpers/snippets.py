"""What pages of the manual ask to be run: files, commands with their output, Python."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from mbsim.manual.book import Page

ROOT = Path(__file__).parents[2]
_FENCE = re.compile(r"^(```+)[ ]*(\S*)[ ]*(.*)$")
_MARK = "\x01"
#: What a program says on a machine that has not compiled yet.
_COMPILING = re.compile(r"^mbsim: compiling")
_OF_IT = re.compile(r" \([\d.]+ s of it compiling\)")


@dataclass
class Block:
    """A fenced block: its kind, the words behind it, its lines, and where it stands."""

    kind: str
    words: list[str]
    lines: list[str]
    line: int

    @property
    def file(self) -> str:
        """The name of the file that the block is, or nothing."""
        return next((word for word in self.words if "." in word), "")

    @property
    def slow(self) -> bool:
        return "slow" in self.words

    @property
    def runs(self) -> bool:
        """Whether something is to be run."""
        if "norun" in self.words or self.file:
            return False
        return self.kind in ("console", "python")


@dataclass
class Command:
    """A command and the lines that a page shows below it."""

    text: str
    shown: list[str] = field(default_factory=list)


def blocks(page: Page) -> list[Block]:
    """Return the fenced blocks of a page in order."""
    found: list[Block] = []
    fence = ""
    for number, line in enumerate(page.text.splitlines(), 1):
        match = _FENCE.match(line)
        if fence and line.strip() == fence:
            fence = ""
        elif fence:
            found[-1].lines.append(line)
        elif match:
            fence = match.group(1)
            found.append(Block(match.group(2), match.group(3).split(), [], number))
    return found


def commands(block: Block) -> list[Command]:
    """Return the commands of a console block; a line that ends in a backslash goes on."""
    found: list[Command] = []
    going_on = False
    for line in block.lines:
        if line.startswith("$ "):
            found.append(Command(line[2:]))
        elif going_on:
            found[-1].text += "\n" + line
        elif found:
            found[-1].shown.append(line)
        else:
            raise AssertionError(f"line {block.line}: output before the first command")
        going_on = line.endswith("\\") and (line.startswith("$ ") or going_on)
    return found


def agrees(shown: list[str], printed: list[str]) -> bool:
    """Return whether output is as a page shows it; `...` stands for anything, also for lines."""
    if not shown:
        return not printed
    if shown[0].strip() == "...":
        rest = shown[1:]
        return any(agrees(rest, printed[k:]) for k in range(len(printed) + 1))
    if not printed:
        return False
    pattern = ".*".join(re.escape(part) for part in shown[0].rstrip().split("..."))
    return bool(re.fullmatch(pattern, printed[0].rstrip())) and agrees(shown[1:], printed[1:])


def as_if_warm(text: str) -> list[str]:
    """Return the lines of output as they are once everything is compiled, without blank ends."""
    lines = [_OF_IT.sub("", line) for line in text.splitlines() if not _COMPILING.match(line)]
    while lines and not lines[-1].strip():
        lines.pop()
    return lines


class Folder:
    """The folder of one page, in which its blocks are run."""

    def __init__(self, path: Path) -> None:
        self.path = path
        programs = path / ".programs"
        programs.mkdir()
        for name in ("mbsim", "python"):
            program = programs / name
            module = " -m mbsim" if name == "mbsim" else ""
            program.write_text(f'#!/bin/sh\nexec "{sys.executable}"{module} "$@"\n')
            program.chmod(0o755)
        for name in ("models", "userfuncs", "tests"):
            (path / name).symlink_to(ROOT / name)
        self._environment = os.environ | {
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "COLUMNS": "100",
        }

    def run(self, page: Page, *, slow: bool) -> None:
        """Write the files of a page and run its blocks, those that are slow only where asked."""
        for block in blocks(page):
            if block.file:
                target = self.path / block.file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text("\n".join(block.lines) + "\n", encoding="utf-8")
            elif block.runs and (slow or not block.slow):
                where = f"{page.name}.md:{block.line}"
                if block.kind == "python":
                    self._python(block, where)
                else:
                    self._console(block, where)

    def _execute(self, command: list[str], given: str) -> tuple[int, str]:
        done = subprocess.run(
            command,
            input=given,
            cwd=self.path,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            timeout=900,
            check=False,
        )
        return done.returncode, done.stdout

    def _python(self, block: Block, where: str) -> None:
        code, printed = self._execute([sys.executable, "-"], "\n".join(block.lines))
        assert code == 0, f"{where}: {printed}"

    def _console(self, block: Block, where: str) -> None:
        asked = commands(block)
        mark = f'code=$?; printf "\\n{_MARK}%d{_MARK}\\n" $code; (exit $code)'
        script = "".join(f"{each.text}\n{mark}\n" for each in asked)
        _, printed = self._execute(["bash", "-s"], script)
        pieces = re.split(f"\n{_MARK}(\\d+){_MARK}\n", printed)
        assert len(pieces) == 2 * len(asked) + 1, f"{where}: {printed}"
        for each, text, code in zip(asked, pieces[0::2], pieces[1::2], strict=False):
            failed = any("error" in line.lower() for line in each.shown)
            assert code == "0" or failed, f"{where}: {each.text} ended with {code}:\n{text}"
            shown = as_if_warm("\n".join(each.shown))
            assert not shown or agrees(shown, as_if_warm(text)), (
                f"{where}: {each.text} prints\n{text}\nand the page shows\n" + "\n".join(shown)
            )

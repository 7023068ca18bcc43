"""What is wrong with a script, line by line: for text cut out of a manual page, and for lint."""

from __future__ import annotations

import ast
import functools
import re

from mbsim.plugins import slip

_SPACES = re.compile("[\u00a0\u1680\u2000-\u200b\u202f\u205f\u3000\ufeff]")
_ZEROS = re.compile(r"\[\s*(0{2,})\s*\]")
_OPENING, _CLOSING = "([{", ")]}"


def diagnose(data: bytes | str, path: str, error: Exception | None = None) -> str:
    """Return one message with every fault of a script that Python does not accept.

    Parameters
    ----------
    data : bytes or str
        The script.
    path : str
        Its file, for the message.
    error : Exception, optional
        What Python said; used if nothing better is found.
    """
    faults: list[tuple[int, str]] = []
    if isinstance(data, str):
        text = data
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
            faults.append((1, "the file is not UTF-8 (read as Latin-1 from here on)"))
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    # each step mends what it reports, so that the next one sees past it
    lines, found = _odd_spaces(lines)
    faults += found
    lines, found = _brackets(lines)
    faults += found
    faults += _zero_lists(lines)
    lines, found = _indentation(lines)
    faults += found
    tree: ast.Module | None
    try:
        tree = ast.parse("\n".join(lines))
    except (SyntaxError, ValueError) as other:
        tree = None
        line = getattr(other, "lineno", None) or 1
        if line not in {place for place, _ in faults}:  # else it has been told in other words
            faults.append((line, str(getattr(other, "msg", other))))
    if tree is not None:
        warned = [
            item for node in tree.body if isinstance(node, ast.FunctionDef)
            for item in slip.unguarded_divisions(node)
        ]  # fmt: skip
        faults += [(line, f"warning: {what}") for line, what in warned]
    if not faults:
        faults.append((getattr(error, "lineno", None) or 1, str(getattr(error, "msg", error))))
    shown = "\n".join(f"  {path}:{line}: {what}" for line, what in sorted(faults, key=_line))
    return f"{path} is not valid Python:\n{shown}"


def _line(fault: tuple[int, str]) -> int:
    """Return the line of a fault, to sort by: faults of one line keep their order."""
    return fault[0]


def _ranges(numbers: list[int], lines: list[str]) -> str:
    """Return 3, 5-8 for 3, 5, 6, 7, 8; a range runs on over lines without text."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and not any(line.strip() for line in lines[runs[-1][1] : number - 1]):
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


def _odd_spaces(lines: list[str]) -> tuple[list[str], list[tuple[int, str]]]:
    """Find spaces that are no spaces to Python, and put plain ones in their place."""
    faults = []
    kinds = sorted({char for line in lines for char in _SPACES.findall(line)})
    for kind in kinds:
        where = [number for number, line in enumerate(lines, 1) if kind in line]
        name = "non-breaking spaces" if kind == "\u00a0" else "spaces of another kind"
        lines_hit = _ranges(where, lines)
        faults.append(
            (where[0], f"{name} (U+{ord(kind):04X}) in line {lines_hit}: use plain spaces")
        )
    return [_SPACES.sub(" ", line) for line in lines], faults


def _code_lines(lines: list[str]) -> list[str]:
    """Return the lines with comments and strings blanked out, docstrings included."""
    shown, quote = [], ""
    for line in lines:
        if quote:
            before, mark, line = line.partition(quote)
            if not mark:
                shown.append("")
                continue
            line = " " * len(before + mark) + line
            quote = ""
        # a whole """text""" goes; one that stays open goes up to the line that closes it
        line = re.sub(r'"""(?:.*?)"""|\'\'\'(?:.*?)\'\'\'', _blank, line)
        opened = re.match(r'([^"\'#]*)("""|\'\'\')', line)
        if opened:
            line, quote = opened.group(1) + " " * 3, opened.group(2)
        shown.append(_code(line))
    return shown


def _blank(match: re.Match[str]) -> str:
    return " " * len(match.group())


def _code(line: str) -> str:
    """Return a line with comment and one-line strings blanked out, at the same columns."""
    return re.sub(r"#.*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'", _blank, line)


def _brackets(lines: list[str]) -> tuple[list[str], list[tuple[int, str]]]:
    """Find closing brackets that nothing opened, and open them where their line begins."""
    faults, mended = [], list(lines)
    open_at: list[tuple[str, int]] = []
    for number, (line, code) in enumerate(zip(lines, _code_lines(lines), strict=True), 1):
        for char in code:
            if char in _OPENING:
                open_at.append((char, number))
            elif char in _CLOSING:
                opening = _OPENING[_CLOSING.index(char)]
                if open_at and open_at[-1][0] == opening:
                    open_at.pop()
                    continue
                statement = line.strip()
                faults.append(
                    (number, f"'{char}' without '{opening}': write '{opening}{statement}'")
                )
                indent = len(line) - len(line.lstrip())
                mended[number - 1] = line[:indent] + opening + mended[number - 1][indent:]
    faults += [(number, f"'{char}' is never closed") for char, number in open_at]
    return mended, faults


def _inside_strings(lines: list[str]) -> set[int]:
    """Return the lines that begin inside a string of several lines."""
    found, quote = set(), ""
    for number, line in enumerate(lines, 1):
        if quote:
            found.add(number)
        for mark in re.findall(r'"""|\'\'\'', line):
            quote = mark if not quote else "" if mark == quote else quote
    return found


def _zero_lists(lines: list[str]) -> list[tuple[int, str]]:
    """Find [000], which Python accepts as the list of one zero."""
    return [
        (
            number,
            f"{match.group()} is a list of one number: "
            f"write [{', '.join('0.0' for _ in match.group(1))}]",
        )
        for number, code in enumerate(_code_lines(lines), 1)
        for match in _ZEROS.finditer(code)
    ]


def _indentation(lines: list[str]) -> tuple[list[str], list[tuple[int, str]]]:
    """Find lines whose indentation fits no block, and move them to the block around them."""
    faults, mended = [], list(lines)
    stack: list[tuple[int, int]] = [(0, 0)]  # indentation in the text, and after mending
    opens, depth, joined = False, 0, False
    in_string = _inside_strings(lines)
    for number, (line, code) in enumerate(zip(lines, _code_lines(lines), strict=True), 1):
        text = code.strip()
        inside = depth > 0 or joined or number in in_string
        depth += sum(code.count(c) for c in _OPENING) - sum(code.count(c) for c in _CLOSING)
        joined = text.endswith("\\")
        if inside or not line.strip() or line.strip().startswith("#"):
            continue
        width = len(line.expandtabs(8)) - len(line.expandtabs(8).lstrip())
        if opens:
            if width > stack[-1][0]:
                stack.append((width, stack[-1][1] + 4))
            else:
                faults.append((number, "indentation: the line above opens a block, indent this"))
        elif width > stack[-1][0]:
            before = stack[-1][0]
            faults.append(
                (
                    number,
                    f"indentation: {width} columns, but nothing opens a block ({before} before): "
                    "move it to the block it belongs to",
                )
            )
            # lines further down may stand at either column
            stack.append((width, stack[-1][1]))
        while width < stack[-1][0]:
            stack.pop()
        if width > stack[-1][0]:
            faults.append((number, f"indentation: {width} columns fit no block above"))
        mended[number - 1] = " " * stack[-1][1] + line.strip()
        opens = text.endswith(":")
    return mended, faults


#: What is found in a text is kept, for a process that runs one model many times.
_KEPT = 256


@functools.lru_cache(maxsize=_KEPT)
def lint(text: str, name: str, with_state: bool = False) -> tuple[str, ...]:
    """Return warnings on a script that Python accepts, each with its line."""
    found: list[tuple[int, str]] = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            last = node.end_lineno or node.lineno
            lines = text.splitlines()[node.lineno - 1 : last]
            zeros = [(line + node.lineno - 1, what) for line, what in _zero_lists(lines)]
            known = {line for line, _ in zeros}
            wrong = slip.wrong_lengths(node, with_state)
            found += zeros + [item for item in wrong if item[0] not in known]
            found += slip.unguarded_divisions(node)
    # two divisions of one line are one warning
    lines_of = dict.fromkeys(sorted(found, key=_line))
    return tuple(f"line {line}: {what}" for line, what in lines_of)


@functools.lru_cache(maxsize=_KEPT)
def reads_parameter(text: str, name: str, position: int) -> bool:
    """Return whether a function reads its parameter at `position`; True if the text cannot tell."""
    tree = ast.parse(text)
    found = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name]
    bound = sum(
        (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id == name)
        or (isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name == name)
        for node in ast.walk(tree)
    )
    if len(found) != 1 or bound != 1 or found[0].decorator_list:
        return True
    every = [*found[0].args.posonlyargs, *found[0].args.args]
    if len(every) <= position:
        return True
    # locals() and the like read every parameter
    wanted = {every[position].arg, "locals", "vars", "eval", "exec", "dir"}
    return any(
        isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in wanted
        for node in ast.walk(found[0])
    )

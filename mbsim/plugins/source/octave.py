"""User subroutines in the MATLAB language, by GNU Octave.

One Octave process serves all functions of a run. Requests and answers go through two pipes of its
own, so that what a function prints cannot get between them:

    request   function number, count of numbers; the numbers (all doubles)
    answer    0, count; the numbers        or        1, count; as many bytes of text

Function 0 adds a function: its numbers are the characters of its file, and the answer how many
arguments it takes. The numbers of function 1, 2, ... are its arguments, one after the other.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mbsim.errors import ModelError
from mbsim.plugins.permission import check

SUFFIX = ".m"
_PROGRAMS = ("octave-cli", "octave")
_SERVER = r"""
1;
in = fopen (getenv ("MBSIM_REQUESTS"), "r");
out = fopen (getenv ("MBSIM_ANSWERS"), "w");
functions = {};
sizes = {};
while true
  head = fread (in, 2, "double");
  if (numel (head) < 2)
    break;
  end
  given = fread (in, head(2), "double").';
  try
    if (head(1) == 0)
      file = char (given);
      [folder, name] = fileparts (file);
      addpath (folder);
      result = nargin (name);
      functions{end + 1} = str2func (name);
    elseif (head(1) < 0)
      sizes{-head(1)} = given;
      result = [];
    else
      arguments = mat2cell (given, 1, sizes{head(1)});
      result = functions{head(1)} (arguments{:});
    end
    if (! (isnumeric (result) || islogical (result)) || ! isreal (result))
      error ("mbsim:result", "returned a %s, not real numbers", class (result));
    end
    fwrite (out, [0, numel(result)], "double");
    fwrite (out, double (result(:)), "double");
  catch problem
    place = "";
    if (! isempty (problem.stack) && ! strcmp (problem.identifier, "mbsim:result"))
      if (problem.stack(1).line > 0)
        place = sprintf ("%s:%d", problem.stack(1).file, problem.stack(1).line);
      end
    end
    text = uint8 ([place, "\n", problem.message]);
    fwrite (out, [1, numel(text)], "double");
    fwrite (out, text, "uint8");
  end
  fflush (out);
end
"""


class OctaveError(Exception):
    """A function in Octave failed; `place` is its file and line, where Octave tells."""

    def __init__(self, place: str, message: str) -> None:
        super().__init__(message)
        self.place = place


@dataclass(frozen=True)
class OctaveFile:
    """A file with a function in the MATLAB language, which is named as the file is."""

    path: Path

    def defines(self, name: str) -> bool:
        """Return whether it is the file of a function of that name."""
        return self.path.stem == name

    def listed(self) -> str:
        """Return the function that others can call, for a message."""
        return self.path.stem


def read_octave(path: Path, name: str, element: str) -> OctaveFile:
    """Return the file of function `name`.

    Raises
    ------
    ModelError
        If it is not there, or is named otherwise than its function.
    """
    path = path.absolute()
    check(path, element)
    if not path.is_file():
        raise ModelError(f"{element}: {path}: No such file or directory")
    if path.suffix.lower() != SUFFIX:
        raise ModelError(f"{element}: {path}: a function in the MATLAB language is in a .m file")
    if path.stem != name:
        raise ModelError(
            f"{element}: {path} does not define {name}: a .m file gives the function that has its "
            f"name, here {path.stem}"
        )
    return OctaveFile(path)


class Octave:
    """The Octave process of a run.

    Raises
    ------
    ModelError
        If there is no Octave on this machine; the message names `element`, who asks for it.
    """

    def __init__(self, element: str) -> None:
        program = next(filter(None, map(shutil.which, _PROGRAMS)), None)
        if program is None or os.name != "posix":
            where = (
                "no octave-cli or octave is found" if os.name == "posix" else f"not on {os.name}"
            )
            raise ModelError(
                f'{element}: interpreter="MATLAB": functions in the MATLAB language are run by GNU '
                f"Octave, and {where}; install it, or write the function in Python, C or Fortran"
            )
        requests, self._requests = os.pipe()
        self._answers, answers = os.pipe()
        pipes = {"MBSIM_REQUESTS": f"/dev/fd/{requests}", "MBSIM_ANSWERS": f"/dev/fd/{answers}"}
        self._process = subprocess.Popen(
            [program, "--quiet", "--no-init-file", "--no-history", "--eval", _SERVER],
            stdin=subprocess.DEVNULL,
            stdout=2,  # what functions print: --json owns standard output
            pass_fds=(requests, answers),
            env={**os.environ, **pipes},
            start_new_session=True,  # Ctrl-C is for the run, which then ends the process
        )
        os.close(requests)
        os.close(answers)
        self._count = 0
        self._files: dict[str, Path] = {}
        self.ended = False

    def add(self, file: OctaveFile, documented: str, npar: int, element: str) -> Callable[..., Any]:
        """Return the function of a file as one of Python, for arguments of `documented` names.

        Raises
        ------
        ModelError
            If Octave cannot read the file, the function takes other arguments, or another file of
            the run has its name.
        """
        names = [name.strip() for name in documented.split(",")]
        first = self._files.setdefault(file.path.stem, file.path)
        if first != file.path:
            raise ModelError(
                f"{element}: {file.path}: {first} has the same name, and Octave knows functions by "
                "their names; rename one"
            )
        try:
            takes = int(self._ask(0, [float(byte) for byte in os.fsencode(file.path)])[0])
        except OctaveError as error:
            text = " ".join(str(error).split())
            raise ModelError(f"{element}: {file.path}: {text}") from None
        if (takes >= 0 and takes != len(names)) or (takes < 0 and -takes - 1 > len(names)):
            raise ModelError(
                f"{element}: {file.path}: {file.path.stem} takes {abs(takes)} arguments, not the "
                f"{len(names)} documented ones ({documented})"
            )
        self._count += 1
        number = self._count
        wide = {"par": npar, **dict.fromkeys(("loci", "locj", "ni", "nj", "x", "xdot"), 3)}
        self._ask(-number, [float(wide.get(name, 1)) for name in names])

        def function(*arguments: Any) -> list[float]:
            numbers: list[float] = []
            for argument in arguments:
                if isinstance(argument, list):
                    numbers += argument
                else:
                    numbers.append(argument)
            return self._ask(number, numbers)

        return function

    def end(self) -> None:
        """End the process; it ends when nobody can ask it any more."""
        if self.ended:
            return
        self.ended = True
        os.close(self._requests)
        os.close(self._answers)
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __del__(self) -> None:
        if hasattr(self, "ended"):
            self.end()

    def _ask(self, number: int, numbers: Sequence[float]) -> list[float]:
        """Return the answer to one request."""
        if self.ended:
            raise OctaveError("", "Octave has been ended")
        request = struct.pack(f"={len(numbers) + 2}d", number, len(numbers), *numbers)
        try:
            os.write(self._requests, request)
        except OSError:
            self._gone()
        failed, count = struct.unpack("=2d", self._read(16))
        if not failed:
            return list(struct.unpack(f"={int(count)}d", self._read(8 * int(count))))
        place, _, message = self._read(int(count)).decode("utf-8", "replace").partition("\n")
        raise OctaveError(place, message)

    def _read(self, size: int) -> bytes:
        parts = b""
        while len(parts) < size:
            part = os.read(self._answers, size - len(parts))
            if not part:
                self._gone()
            parts += part
        return parts

    def _gone(self) -> None:
        raise OctaveError("", f"Octave ended, with code {self._process.wait()}")


#: The Octave of the run; the functions that it serves keep it alive.
_running: list[weakref.ref[Octave]] = []


def running(element: str) -> Octave:
    """Return the Octave of this run, started if there is none."""
    found = _running[-1]() if _running else None
    if found is None or found.ended:
        found = Octave(element)
        _running[:] = [weakref.ref(found)]
    return found


def end_all() -> None:
    """End Octave, after a run."""
    while _running:
        found = _running.pop()()
        if found is not None:
            found.end()

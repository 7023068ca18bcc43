"""What can go wrong, and the exit code that the command line gives for it.

MbsimError
├── ModelError        2  the deck, an option or a file the deck names is at fault
│   └── DeckError     2  several faults of one deck, each with file and line
├── SolverError       3  the integrator gave up: time, reason, element
├── PluginError       4  a user subroutine failed while the run went on
├── ResultsError      5  results could not be written
│   ├── UnknownSignal 2  a name that a result file does not have
│   └── NoSuchResults 2  there is no file of that name
└── Interrupted     130  Ctrl-C (143: SIGTERM, 129: SIGHUP); results up to there are kept
"""

from __future__ import annotations

from dataclasses import dataclass


class MbsimError(Exception):
    """Base of every error that mbsim raises for a reason a user can act on."""

    exit_code = 1


class ModelError(MbsimError):
    """The model, an option or a file named by the model cannot be used."""

    exit_code = 2


@dataclass(frozen=True)
class Fault:
    """One fault of a deck, with all a user needs to mend it.

    `element` is the deck's own name and id, for example ``Body_Rigid[30102]``;
    `message` says what is wrong and what is allowed.
    """

    file: str
    line: int
    element: str
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: "
        return place + (f"{self.element}: " if self.element else "") + self.message


class DeckError(ModelError):
    """All faults of one deck, raised once; `faults` holds them in order of line."""

    def __init__(self, faults: list[Fault]) -> None:
        self.faults = sorted(faults, key=lambda fault: (fault.file, fault.line))
        super().__init__("\n".join(str(fault) for fault in self.faults))


class SolverError(MbsimError):
    """The integrator could not go on; the message says when, why and at which element."""

    exit_code = 3


class PluginError(MbsimError):
    """A user subroutine raised, or returned something that is not a force."""

    exit_code = 4


class ResultsError(MbsimError):
    """A result file could not be written or read."""

    exit_code = 5


class UnknownSignal(ResultsError):
    """A name is not one of a result file's signals; the message says which there are."""

    exit_code = 2


class NoSuchResults(ResultsError):
    """There is no result file of that name: the argument is wrong, nothing is damaged."""

    exit_code = 2


class Interrupted(MbsimError):
    """A signal stopped the run; everything recorded so far is kept.

    Parameters
    ----------
    message : str
    signal : int
        Its number; the exit code is 128 more, as a shell has it.
    """

    exit_code = 130

    def __init__(self, message: str, signal: int = 2) -> None:
        super().__init__(message)
        self.exit_code = 128 + signal

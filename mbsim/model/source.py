"""What the elements of a deck have in common: where they stand, and subroutines of the user."""

from __future__ import annotations

from dataclasses import dataclass, field

#: Marks a field from which no result follows: where a file is, how a deck says something.
ASIDE = "aside"
NO_RESULT = {ASIDE: True}


@dataclass(frozen=True)
class Source:
    """Where an element stands: deck file and line."""

    file: str = ""
    line: int = 0


@dataclass(frozen=True)
class Subroutine:
    """A user subroutine as the deck names it: USER(...) values, function, file."""

    par: tuple[float, ...] = ()
    fnc_name: str = ""
    dll_name: str = field(default="", metadata=NO_RESULT)  # absolute path of a library, or empty
    # absolute path, or empty where --plugin must give it
    script_name: str = field(default="", metadata=NO_RESULT)
    interpreter: str = ""
    language: str = ""  # of the library's function: C, FORTRAN, or empty where its name tells
    source: Source = Source()


@dataclass(frozen=True)
class StateSubroutine(Subroutine):
    """A subroutine that gives the slopes of several states, and outputs (GSESUB)."""

    element_id: int = 0  # of the Control_StateEqn
    state_ids: tuple[int, ...] = ()  # Control_Diff, in their order
    input_ids: tuple[int, ...] = ()  # Reference_Variable
    outputs: int = 0


@dataclass(frozen=True)
class RelationSubroutine(Subroutine):
    """A subroutine that gives a relation of displacements, and its derivatives (COUSUB)."""

    count: int = 0  # of displacements
    first: str = ""  # function of the first derivatives (COUXX)
    second: str = ""  # of the second (COUXX2)
    named: bool = False  # whether the deck names both: then they must be there

    @property
    def results(self) -> int:
        """How many numbers it gives: the relation, its first and its second derivatives."""
        return 1 + self.count + self.count * self.count

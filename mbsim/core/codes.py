"""What hooks and laws return where they fail: one list of codes, each with its meaning.

`run.failures` says each of them in the user's words, with the element at fault.
"""

from __future__ import annotations

from enum import IntEnum


class Code(IntEnum):
    """Why a hook failed; 0 is success."""

    RAISED_INTERPRETED = 1  # a user's function; the guard in `plugins` holds the exception
    RAISED_COMPILED = 2  # one that was compiled, which is run again interpreted
    NOT_FINITE = 3  # a force or acceleration
    DETECTOR_FAILED = 4  # FCL; the detector holds the exception
    USER_NOT_FINITE = 5  # what a user's law made of finite input
    TOO_FAR = 6  # a trial point that the list of near pairs does not reach: a shorter step does
    CROWDED = 7  # more near pairs than there are places for
    MANY_POINTS = 8  # more contact points in reach than places: a shorter step reaches fewer
    CONTRADICTION = 9  # constraints, in the course of the motion
    JAMMED = 10  # friction and reactions raise each other without end
    NO_ROOM = 11  # more coupled bodies than a linearisation has places for
    UNSOLVED_ELEMENT = 12  # a Force_Element's residual is nowhere 0
    UNSETTLED = 13  # forces and the reactions that they follow from
    USER_NORMAL_FAILED = 14  # a user's normal law raised when compiled, or made no number
    NOT_CONVERGED = 50  # an implicit method's equations of a step: a shorter one is tried
    SINGULAR = 51  # `factor`: there is no solution, or too many
    STOPPED_BY_USER = 100
    NOT_REPEATED = 101  # f at a point differs each time it is asked for
    END_OF_CURVE = 102  # a higher pair has come to where a curve or surface ends
    NO_ONE_TOUCH = 103  # a higher pair has no one point in which it touches


#: Codes from here on end the run without another try.
AT_ONCE = 100

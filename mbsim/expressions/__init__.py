"""The deck's expression language: text to tree; what compiled code makes of it is in `dynamics`."""

from mbsim.expressions.tree import Expression as Expression

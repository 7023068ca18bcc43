"""The deck's expression language: text to tree; what compiled code makes of it is in `dynamics`.

`functions` is the table of all functions, `parse` makes a tree, `elementary` computes what does
not look at the model.
"""

from mbsim.expressions.tree import Expression as Expression

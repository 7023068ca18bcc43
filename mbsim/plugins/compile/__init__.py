"""From the text of a Python subroutine to machine code that gives the same numbers."""

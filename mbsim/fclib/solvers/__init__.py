"""Solvers of the problem in blocks, one a file."""

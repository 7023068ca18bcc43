"""Kinds of forces between markers, one a file."""

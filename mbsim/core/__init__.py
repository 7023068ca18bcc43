"""Leaf helpers: the compile policy, rotations, blends, registries, units."""

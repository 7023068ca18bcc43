"""Shapes and where they touch: closed-form pairs, motion bounds, the FCL detector."""

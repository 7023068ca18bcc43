"""Colours of bodies, where the deck gives none."""

from __future__ import annotations

#: In turn, red, green, blue as 0xRRGGBB.
PALETTE = (
    *(0x3F7FD0, 0xE0813A, 0x4FA66A, 0xC9556B, 0x8A6FC4),
    *(0x3AA6A6, 0xD0A52F, 0x9A7B5F, 0xD57FB0, 0x7D93AB),
)
#: Of what stands still.
FIXED = 0x9AA4AD


def colour_of(given: int, body: int) -> int:
    """Return what the deck gives, else the colour of the body's index (-1: it stands still)."""
    if given >= 0:
        return given
    return FIXED if body < 0 else PALETTE[body % len(PALETTE)]

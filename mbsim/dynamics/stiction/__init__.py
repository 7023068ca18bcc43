"""Friction without give: what sticks is held by equations."""

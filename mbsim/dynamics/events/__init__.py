"""How long steps may be, and where they end."""

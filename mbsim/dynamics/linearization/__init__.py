"""The linearised mechanism, for implicit methods."""

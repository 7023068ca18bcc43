"""Methods for y' = f(t, y); they know a `Problem`, no bodies."""

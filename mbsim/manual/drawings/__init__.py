"""Pictures of the manual, one module a chapter; each function registers itself by `picture`."""

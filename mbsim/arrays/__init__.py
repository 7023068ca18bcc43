"""Every array of the compiled pipeline, declared once."""

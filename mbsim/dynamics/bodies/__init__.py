"""Where bodies and markers are, and how they move."""

"""What touches what, and what pushes there."""

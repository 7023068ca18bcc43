"""A run: its settings, its loop, what may end it, and what is asked of it afterwards."""

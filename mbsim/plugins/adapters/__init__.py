"""Compiled code between the laws' internal signatures and what users write."""

"""The stages of an evaluation, and the hooks that integrators call."""

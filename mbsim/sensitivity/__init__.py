"""Sensitivities: derivatives of a run's motion with respect to parameters of its deck."""

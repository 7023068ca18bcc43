"""Before a run: assembly, velocities to start with, static equilibrium."""

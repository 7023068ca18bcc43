"""Friction laws: from slip velocity and normal force to the friction force."""

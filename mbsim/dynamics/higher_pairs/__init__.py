"""Points and curves of a body that stay on curves and surfaces of another."""

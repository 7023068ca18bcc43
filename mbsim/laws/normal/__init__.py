"""Normal laws: from depth and its rate to the normal force."""

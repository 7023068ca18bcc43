"""One joint a file: the equations that hold between its markers I and J."""

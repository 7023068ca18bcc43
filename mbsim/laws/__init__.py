"""Contact laws, one a file: a plain function of numbers, its parameters and its source."""

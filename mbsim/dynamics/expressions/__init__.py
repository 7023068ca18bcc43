"""Programs of expressions: values, and derivatives where they are asked for."""

"""jamshape."""

"""Cases of each part of jamshape, for all shapes of the table."""

"""The dynamical matrix, its modes, and what follows from them."""

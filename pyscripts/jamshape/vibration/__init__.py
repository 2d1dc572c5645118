"""Dynamical matrix, vibrational modes, and derived quantities."""

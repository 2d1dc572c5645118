"""Extreme packings: how they are made of arrays and squeezed, and those of each shape."""

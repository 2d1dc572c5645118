"""Definitions of the shapes: one file for each, and their table; other Python knows no shape by name."""

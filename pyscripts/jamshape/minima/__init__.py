"""Minimisers, and packings at a chosen energy."""

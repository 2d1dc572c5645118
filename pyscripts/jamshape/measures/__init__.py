"""Measurements on packings and runs: order, contact statistics, onset of jamming."""

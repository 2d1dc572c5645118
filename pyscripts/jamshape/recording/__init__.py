"""Drivers and the recorder: interruption and resumption of all long calculations."""

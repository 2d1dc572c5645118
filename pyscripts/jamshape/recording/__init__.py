"""Drivers and the recorder: how everything that goes on for long is put down and taken up again."""

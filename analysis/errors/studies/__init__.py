"""Common parts of the studies of error: finished runs on disk, starts, curves of error against time, tables."""

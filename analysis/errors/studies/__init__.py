"""What the studies of error share: finished runs that are kept, starts, curves of error against time, tables."""

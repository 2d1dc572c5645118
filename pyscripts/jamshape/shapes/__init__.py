"""What shapes are: one file for each, and the table of them; the only Python that knows which there are."""

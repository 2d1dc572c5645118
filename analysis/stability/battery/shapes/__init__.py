"""What the battery tries of each shape: a row each, and the table of rows."""

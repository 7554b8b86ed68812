"""Files and recordings, read and written; imports nothing of the cell above it."""

"""Text for the terminal: output, progress, summaries."""

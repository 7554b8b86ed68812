"""What the frames so far are worth, while the run goes on, and whether they are enough."""

"""The cell put together: real, simulated and peer devices; imports the sequencer and below."""

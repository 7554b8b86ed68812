"""The operator's side: command line, plans, sequencer, recording, report."""

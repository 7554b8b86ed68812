"""Mix-ups of the log, tried before any physics: conventions, units, pairing, the wrong arm."""

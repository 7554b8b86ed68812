"""The search for a law of what has no name: scan, contest, cross-validation, description."""

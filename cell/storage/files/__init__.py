"""Plan and cell files: YAML validated by frozen models, all errors of a file at once."""

"""One file per program that a camera can be handed to."""

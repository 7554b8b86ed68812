"""A fuzz campaign over everything that is read from files and from the wire."""

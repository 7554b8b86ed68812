"""Drawings of the report, one file each; every one is a function of the report's data."""

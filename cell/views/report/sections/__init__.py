"""The report's sections, one file each; every one is a function from the data to HTML."""

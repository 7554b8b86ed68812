"""Where simulation and recording differ: which link, which physics, and proof that it is so."""

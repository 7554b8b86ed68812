"""`cell run` through the real drivers against peers, with a fault at an instant of the run."""

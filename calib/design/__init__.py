"""Which views make what a user needs least uncertain."""

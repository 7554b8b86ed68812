"""Maximum likelihood along the chain: per-frame poses eliminated, noise levels estimated."""

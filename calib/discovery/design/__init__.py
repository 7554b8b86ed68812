"""What a set of poses can show, before or after a recording, and which poses would show more."""

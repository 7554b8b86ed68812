"""The one loop that owns the arm: move, settle, grab, check, log; imports storage only."""

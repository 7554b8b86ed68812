"""The live page: what a run does, seen in a browser, with Pause, Skip and Stop.

The page only reads what the run has published and sets the flags the loop looks at. It runs in a
thread of its own; whatever becomes of it, the run does not notice.
"""

"""`cell init`: a cell file for this bench from a few answers.

Nothing is imported here: the command line takes the choices from `answers` without any arrays.
"""

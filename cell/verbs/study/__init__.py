"""Studies that outgrow one machine: many simulated runs or many recordings, on Dask distributed.

Needs the extra `study`; `cell.verbs.study.extra` says so where it is missing.
"""

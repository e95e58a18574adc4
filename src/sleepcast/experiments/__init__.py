"""Experiments: a scenario run many times, with other settings and other chance, and what came of it as a table.

plan       what is varied, what is measured, and the runs that follow from it
measures   one number of a whole fleet: `mean fuel`, `share (IN bravo)`, or a function of yours
results    a folder with everything that was found, safe against interruption; its table as Parquet or CSV
run        one run; many at once on worker processes; the same again, to verify
figures    figures of a table; `drawing` draws them, and is a program that stands alone
"""

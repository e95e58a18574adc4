"""Experiments: a scenario run many times, with other settings and other chance, and what came of it as a table.

plan       what is varied, what is measured, and the runs that follow from it
measures   one number of a whole fleet: `mean fuel`, `share (IN bravo)`, or a function of yours
search     points suggested on the way, where a measure becomes as large or small as it can
results    a folder with everything that was found, safe against interruption; its table as Parquet or CSV
run        one run; many at once on worker processes; the same again, to verify
findings   what a sweep has found so far, for those who watch it
figures    figures of a table; `drawing` draws them, and is a program that stands alone
"""

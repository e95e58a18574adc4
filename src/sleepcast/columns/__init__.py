"""Tables of many robots, slot x robot: what the fleet's minds and the desk's telemetry have in common.

values       variables and groups as columns, and which robots something refers to
machine      evaluates a program for many robots                pure      the built-in functions over columns
evaluation   budget and faults of one evaluation                telemetry what robots told last, and tests on it
"""

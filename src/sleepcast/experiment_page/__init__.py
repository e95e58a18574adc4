"""The page of an experiment: how far a sweep has come, curves that grow with it, and any of its runs on a page.

`server` serves the page beside the sweep, `session` is one open page, `messages` are what both say, and `opened` starts
the page of a single run.
"""

"""The features of the page, a module each: what is asked, what is answered, and what a source needs for that.

A module that is put here is found by `console/registry`, which collects them; nothing else has to know it.
"""

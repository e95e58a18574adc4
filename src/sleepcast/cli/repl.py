"""`sleepcast repl`: a conversation with one robot's mind.

A line that begins with `:` asks about the mind, everything else is evaluated in it. At a terminal the editor of
`prompt` reads the lines; from a pipe they are read as they come. Values go to standard output, the rest to standard
error, as with `eval`.
"""

from __future__ import annotations

"""Runs under MicroPython: the node of main.py, with a body that tells when it is brought to rest, until interrupted."""

import json

from main import start

with open("config.json") as opened:
    node = start(json.load(opened))
node.body.stop = lambda: print("at rest")
print("%s is up" % node.name)
try:
    node.run()
except KeyboardInterrupt:
    print("ended")

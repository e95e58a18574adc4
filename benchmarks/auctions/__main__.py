"""Rounds of BEST and QUORUM, counted.

python -m benchmarks.auctions                 on a made radio: 10,000 rounds of each, 0 to 50 % lost
python -m benchmarks.auctions --rounds 100    fewer of them
python -m benchmarks.auctions --simulated     10,000 rounds of each in a simulated swarm, on its radio
python -m benchmarks.auctions --udp           500 rounds on real UDP, with processes that are killed
"""

from __future__ import annotations

import argparse
import sys

from benchmarks.auctions import made, on_udp, simulated

LOSSES = (0.0, 0.1, 0.2, 0.3, 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description="Rounds of BEST and QUORUM where messages are lost.")
    parser.add_argument("--rounds", type=int, help="10,000 each on a made radio, 500 on UDP unless it is said")
    parser.add_argument("--loss", type=float, action="append", help="share of messages that are lost, e.g. 0.5")
    parser.add_argument("--udp", action="store_true", help="real UDP, and processes that are killed")
    parser.add_argument("--simulated", action="store_true", help="the radio and the minds of a simulated swarm")
    options = parser.parse_args()
    many = simulated.rows if options.simulated else made.rows
    rows, usual = (on_udp.rows, 500) if options.udp else (many, 10_000)
    sys.exit(not rows(options.loss or LOSSES, options.rounds or usual))


if __name__ == "__main__":
    main()

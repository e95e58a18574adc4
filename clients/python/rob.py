"""A Scout wanders; after a datagram it stops as soon as something in front is less than ten inches away, and stays."""

from __future__ import annotations

from itertools import count
from select import select

from scout import begin, nearest_front, options, run, wander, whole

from sleepcast.channel.plain_datagrams import Datagrams

STAND_OFF = 10
"""Inches."""


def main() -> None:
    parser = options(__doc__ or "")
    parser.add_argument("-d", "--datagrams", type=whole(1, 65_535), help="the port to listen at (5000 + the robot)")
    parser.add_argument("-l", "--listen", default="127.0.0.1", help="the address to listen at (%(default)s)")
    parser.add_argument("-q", "--quit", action="store_true", help="end when it stands")
    given = parser.parse_args()
    robot, port = given.robot, given.datagrams or 5000 + given.robot
    told = stopped = said = False
    with Datagrams(given.listen, port) as ears, begin(given) as nomad:
        print(f"robot {robot} wanders and listens at port {ears.port}", flush=True)
        for _ in range(given.loops) if given.loops else count():
            for first, second, third in ears.receive():
                print(f"robot {robot} was told {first:.2f} {second:.2f} {third:.2f}", flush=True)
                told = True
            stopped = stopped or (told and nearest_front(nomad.state) < STAND_OFF)
            state = nomad.st() if stopped else wander(nomad)
            if stopped and not said and not any(state.velocities):
                print(f"robot {robot} stopped with {nearest_front(state)} in ahead", flush=True)
                said = True
            if said and given.quit:
                break
            select([ears], [], [], given.pause / 1000.0)


if __name__ == "__main__":
    run(main)

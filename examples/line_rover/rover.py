"""The robot: a small rover that speaks lines of text over TCP. It knows nothing of sleepcast.

    drive SPEED TURN_RATE      m/s and rad/s; each line is answered by the next one
    time X Y HEADING SPEED TURN_RATE BATTERY       s, m, m, rad, m/s, rad/s, and 0 to 1

It stands if it has heard nothing for half a second.
"""

import argparse
import socketserver
import time
from math import cos, hypot, pi, remainder, sin

QUIET = 0.5


class Rover:
    """Where it is, and how it goes."""

    def __init__(self) -> None:
        self.time = self.x = self.y = self.heading = self.speed = self.turn_rate = 0.0
        self.battery, self.heard = 1.0, 0.0

    def advance(self, seconds: float) -> None:
        self.time += seconds
        if self.time - self.heard > QUIET:
            self.speed = self.turn_rate = 0.0
        before = self.x, self.y
        self.heading = remainder(self.heading + self.turn_rate * seconds, 2.0 * pi)
        self.x += self.speed * cos(self.heading) * seconds
        self.y += self.speed * sin(self.heading) * seconds
        self.battery = max(0.0, self.battery - hypot(self.x - before[0], self.y - before[1]) / 10_000.0)

    def answer(self, line: str) -> str:
        word, speed, turn_rate = line.split()
        if word == "drive":
            self.speed, self.turn_rate, self.heard = float(speed), float(turn_rate), self.time
        measured = (self.time, self.x, self.y, self.heading, self.speed, self.turn_rate, self.battery)
        return " ".join(f"{value:.4f}" for value in measured)


class Talk(socketserver.StreamRequestHandler):
    """One program that drives the rover."""

    rover = Rover()
    began = time.monotonic()

    def handle(self) -> None:
        for line in self.rfile:
            self.rover.advance(time.monotonic() - self.began - self.rover.time)
            self.wfile.write(f"{self.rover.answer(line.decode())}\n".encode())


def main() -> None:
    parser = argparse.ArgumentParser(description="A small rover that speaks lines of text.")
    parser.add_argument("--port", type=int, default=9_000)
    socketserver.TCPServer.allow_reuse_address = True
    with socketserver.TCPServer(("127.0.0.1", parser.parse_args().port), Talk) as server:
        print(f"the rover listens at 127.0.0.1:{server.server_address[1]}", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    main()

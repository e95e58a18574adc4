"""What goes on that a person should know of is said in a sentence: at the robots, and at every desk."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from benchmarks.channel.flooder import forged

from cli.calling import LONGEST, Called, again_until, called_warm
from cli.terminal import terminal
from cli.test_swarm import channel, swarm
from sleepcast.channel.keyring import development_keys, keys_folder
from sleepcast.channel.transports.udp import UdpTransport

__all__ = ["channel"]

FORGED = "forged messages a second under key"


@contextmanager
def attacked(uri: str) -> Iterator[str]:
    """Somebody forges some hundred messages a second under the desk's key, whose id begins as is given."""
    key = development_keys(keys_folder())[0].id
    made, going = forged("desk", key, "stop", 512), True

    def attack() -> None:
        with closing(UdpTransport(uri)) as mouth:
            while going:
                for datagram in made:
                    mouth.send(datagram)
                    time.sleep(0.003)

    thread = threading.Thread(target=attack)
    thread.start()
    try:
        yield key.hex()[:4]
    finally:
        going = False
        thread.join()


def test_forgeries_are_told_at_the_robots_and_at_every_desk(channel: str) -> None:
    def on_air(*arguments: str) -> Called:
        return called_warm(*arguments, "--channel", channel)

    with swarm(3, channel) as robots, attacked(channel) as key:
        wanted = f"{FORGED} {key} (desk)"
        # Again, for on a busy machine there may be fewer forgeries in the moment at which somebody looks.
        again_until(
            lambda table: any(wanted in each for each in json.loads(table.out)["notices"]),
            lambda: on_air("watch", "--once", "--json"),
        )
        again_until(lambda table: wanted in table.out.replace("\n", " "), lambda: on_air("watch", "--once"))
        again_until(lambda found: wanted in found.err, lambda: on_air("who", "(> id 1)"))
        with terminal(["desk", "--channel", channel], Path.home()) as live:
            live.wait_for(f"{FORGED} {key}")
        robots.send_signal(signal.SIGINT)
        _, told = robots.communicate(timeout=LONGEST)
    assert f"{FORGED} {key} (desk)" in told
    assert told.count("somebody sends") <= 3, "and not at every tick"

"""Two robots of one name on the command line: both say so, and no desk takes one of them for both."""

from __future__ import annotations

import json
import re
import signal

from cli.calling import again_until, called_warm
from cli.test_stop import wait_for
from cli.test_swarm import channel, swarm
from processes import SLEEPCAST, running

__all__ = ["channel"]

BOTH_HEARD = re.compile(r"2 robots have the name r1, one at 1\S+ \(epoch \d+\), one at 1\S+ \(epoch \d+\)")
"""What a desk says that has heard both; of one that it only was told of, it does not know the address."""


def test_a_swarm_and_a_node_have_one_name(channel: str) -> None:
    def on_air(*arguments: str) -> tuple[int, str, str]:
        found = called_warm(*arguments, "--channel", channel)
        return found.status, found.out, found.err

    node = (*SLEEPCAST, "node", "--name", "r1", "--body", "sim", "--no-store", "--channel", channel)
    with swarm(2, channel) as many, running(*node, up="r1 is up") as one:
        for process in (many, one):
            assert "another robot has our name r1, one at 1" in wait_for(process, "our name")[-1]

        asked = json.loads(on_air("ask", "x", "--json")[1])
        assert (asked["matched"], asked["fault"], asked["n"]) == (["r2"], ["r1"], 1)
        assert asked["faults"]["r1"].startswith("2 robots have this name: one ")

        one.send_signal(signal.SIGSTOP)
        try:
            status, out, err = on_air("stop", "--timeout", "1")
        finally:
            one.send_signal(signal.SIGCONT)
        assert status == 1
        assert "stopped 1: r2" in out
        assert "2 robots have the name r1: " in out
        assert "has not answered" in out
        assert "not confirmed by 1 of 2 robots" in err
        assert "give each a name of its own: names 1: r1" in err

        status, out, err = again_until(lambda found: "silent 0" in found[1], lambda: on_air("stop", "--timeout", "5"))
        assert status == 1, "somebody has to look at it"
        assert "stopped 2: r1, r2" in out
        assert out.count(" has answered") == 2

        status, out, err = on_air("send", "(WHEN (> id 0) (JOIN bravo))")
        assert status == 2
        assert "warning: 2 robots have the name r1, one " in err
        assert "(--anyway)" in err
        assert "matched 2" not in out
        watched = json.loads(on_air("watch", "--once", "--json")[1])
        assert [(robot["name"], robot["shared"]) for robot in watched["robots"]] == [("r1", True), ("r2", False)]
        assert watched["notices"][0].startswith("2 robots have the name r1, one ")
        again_until(lambda found: BOTH_HEARD.search(found[1]), lambda: on_air("watch", "--once", "--json"))
    assert "2 robots have the name r1, one " in called_warm("journal").out

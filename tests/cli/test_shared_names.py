"""Two robots of one name on the command line: both say so, and no desk takes one of them for both."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from channel.test_udp import free_port
from cli.calling import Called, again_until, called_warm
from cli.test_stop import wait_for
from cli.test_swarm import at_rest, swarm
from processes import SLEEPCAST, live_in, running

BOTH_HEARD = re.compile(r"2 robots have the name r1, one at 1\S+ \(epoch \d+\), one at 1\S+ \(epoch \d+\)")
"""What a desk says that has heard both; of one that it only was told of, it does not know the address."""


@dataclass
class Shared:
    """Two robots of the name r1, one in a swarm with r2, and what each said when it heard of the other."""

    channel: str
    node: subprocess.Popen[str]
    said: list[str]

    def on_air(self, *arguments: str) -> Called:
        return called_warm(*arguments, "--channel", self.channel)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    uri = f"udp://239.255.83.77:{free_port()}?interface=lo"
    node = (*SLEEPCAST, "node", "--name", "r1", "--body", "sim", "--no-store", "--channel", uri)
    with pytest.MonkeyPatch.context() as patch:
        home = tmp_path_factory.mktemp("home")
        live_in(home, patch)
        with swarm(2, uri, *at_rest(home)) as many, running(*node, up="r1 is up") as one:
            yield Shared(uri, one, [wait_for(process, "our name")[-1] for process in (many, one)])


def test_both_say_so(shared: Shared) -> None:
    assert ["another robot has our name r1, one at 1" in line for line in shared.said] == [True, True]


def test_what_both_answer_is_a_fault(shared: Shared) -> None:
    asked = json.loads(shared.on_air("ask", "x", "--json").out)
    assert (asked["matched"], asked["fault"], asked["n"]) == (["r2"], ["r1"], 1)
    assert asked["faults"]["r1"].startswith("2 robots have this name: one ")


def test_a_stop_that_one_of_them_has_not_answered_is_not_confirmed(shared: Shared) -> None:
    shared.node.send_signal(signal.SIGSTOP)
    try:
        stopped = shared.on_air("stop", "--timeout", "1")
    finally:
        shared.node.send_signal(signal.SIGCONT)
    assert stopped.status == 1
    assert "stopped 1: r2" in stopped.out
    assert "2 robots have the name r1: " in stopped.out
    assert "has not answered" in stopped.out
    assert "not confirmed by 1 of 2 robots" in stopped.err
    assert "give each a name of its own: names 1: r1" in stopped.err


def test_a_stop_that_both_have_answered_is_confirmed_but_no_success(shared: Shared) -> None:
    stopped = again_until(lambda found: "silent 0" in found.out, lambda: shared.on_air("stop", "--timeout", "5"))
    assert stopped.status == 1, "somebody has to look at it"
    assert "stopped 2: r1, r2" in stopped.out
    assert stopped.out.count(" has answered") == 2


def test_what_is_sent_to_both_is_refused(shared: Shared) -> None:
    refused = shared.on_air("send", "(WHEN (> id 0) (JOIN bravo))")
    assert refused.status == 2
    assert "warning: 2 robots have the name r1, one " in refused.err
    assert "(--anyway)" in refused.err
    assert "matched 2" not in refused.out


def test_a_look_marks_the_name(shared: Shared) -> None:
    def marks(found: Called) -> bool:
        robots = json.loads(found.out)["robots"]
        return [(robot["name"], robot["shared"]) for robot in robots] == [("r1", True), ("r2", False)]

    watched = json.loads(again_until(marks, lambda: shared.on_air("watch", "--once", "--json")).out)
    assert watched["notices"][0].startswith("2 robots have the name r1, one ")


def test_a_desk_that_has_heard_both_says_where_they_are(shared: Shared) -> None:
    again_until(lambda found: BOTH_HEARD.search(found.out), lambda: shared.on_air("watch", "--once", "--json"))


def test_the_journal_has_it(shared: Shared) -> None:
    shared.on_air("ask", "x")
    assert "2 robots have the name r1, one " in called_warm("journal").out

"""Robots of one process whose computer has no real-time clock take their time from an operator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from sleepcast.channel import Kind
from sleepcast.channel.clock_sync import differs, took
from sleepcast.channel.payload import TOOK
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.core.clock import MADE, UnixClock


class Zeroed(Protocol):
    """Something whose time began at a moment, s of Unix time."""

    zero: float


def seek_time(
    listening: ReliableDelivery, session: ChannelSession, zeroed: Iterable[Zeroed], say: Callable[[str], None]
) -> None:
    """If the clock is plainly wrong, ask for the time; the robots' own time goes on as it does. listening: what hears
    for them; session: of the one that tells the operators; zeroed: all whose time began by the wrong clock."""
    if UnixClock().now() >= MADE:
        return
    everything = list(zeroed)

    def take(behind: float, whose: str) -> None:
        UnixClock.advance(behind)
        for each in everything:
            each.zero += behind
        body: dict[str, object] = {"label": "clock", "values": [behind], TOOK: whose}
        session.delivery.post(Kind.REPORT, UnixClock().now(), body=body)
        session.flush()
        say(took([session.delivery.name], whose, differs(-behind)))

    say("this computer's clock is plainly wrong: nothing but STOP is obeyed until an operator has told the time")
    listening.seek_time(take)

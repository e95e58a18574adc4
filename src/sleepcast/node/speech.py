"""What a robot says: answers, reports, what it tells other robots, and pings. All of it waits in the outbox until
somebody carries it away, and all of it is bounded.
"""

from __future__ import annotations

from collections import deque
from math import inf, isnan, nan

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.payload import HOPS
from sleepcast.core.clock import Clock
from sleepcast.node.telemetry import NOTHING, Details

MAX_OUTBOX = 256
"""Things said in one tick; the rest is dropped and counted."""
MAX_EVALUATED = 256
"""Messages whose outcome waits for somebody to keep it: what comes in one tick, and STOPs between two of them."""
REPORTS_A_SECOND = 20
"""Reports of one robot that go on the air in a second of its clock: a rule that speaks at every tick is heard."""
TELL_SECONDS = 5.0
"""How long what a robot tells others may still be acted on."""
TELLS_A_SECOND = 2.0
"""What one robot may tell others in a second, in the long run: a thousand of them share one radio."""
TELL_BURST = 8
"""What it may tell at once after some quiet."""
TELLS_TOO_OFTEN = f"tells too often: more than {TELLS_A_SECOND:g} a second are dropped"
TELLS_TOO_FAR = "did not tell on what came by its last hop"
"""What it reports, once until it has been quiet, when it does not tell something."""


class Speaker:
    """One robot's voice. lost: messages and sayings that found no room. evaluated: the latest messages that it had an
    answer to, the outcome, and the robot's time, for whoever keeps that and takes it out. zero: when its time began, s
    of Unix time, where that matters; clock: tells that time, None where the time of the tick will do."""

    def __init__(self, name: str) -> None:
        self.name, self.epoch = name, 0
        self.outbox: list[Message] = []
        self.pings: list[float] = []
        self.lost = 0
        self.evaluated: deque[tuple[Message, str, float]] = deque(maxlen=MAX_EVALUATED)
        self._now, self.zero = 0.0, 0.0
        self.clock: Clock | None = None
        self._printed: list[tuple[str, tuple[float, ...]]] | None = None
        """What the text under way has reported, while somebody waits for its result."""
        self._sequence = 0
        self._reported_in, self._reported = 0, 0
        self._telling_until = 0.0
        """When all that it has told would be over at `TELLS_A_SECOND`, s: a leaky bucket in one number."""
        self._told_less = False
        """Whether something was not told since it was quiet last."""

    def _say(self, kind: Kind, *, text: str = "", deadline: float = inf, body: dict[str, object] | None = None) -> None:
        if len(self.outbox) >= MAX_OUTBOX:
            self.lost += 1
            return
        self._sequence += 1
        self.outbox.append(
            Message(self.name, self.epoch, self._sequence, kind, self._now, deadline, text, False, body or {})
        )

    def _answer(
        self, message: Message, outcome: str, value: float = nan, fault: str = "", told: Details = NOTHING
    ) -> None:
        said = {"command": message.id, "outcome": outcome, "value": None if isnan(value) else value}
        self._say(Kind.ANSWER, body={**said, "fault": fault or None, **told})
        self.evaluated.append((message, outcome, self._now if self.clock is None else self.clock.now() - self.zero))

    def _report(self, label: str, values: tuple[float, ...]) -> None:
        if self._printed is not None:
            self._printed.append((label, values))
        second = int(self._now)
        if second != self._reported_in:
            self._reported_in, self._reported = second, 0
        self._reported += 1
        if self._reported > REPORTS_A_SECOND:
            self.lost += 1
            return
        self._say(Kind.REPORT, body={"label": label, "values": [None if isnan(v) else v for v in values]})

    def remark(self, said: str) -> None:
        """Report something that no expression has asked for."""
        self._report(said, ())

    def _may_tell(self, hops: int) -> bool:
        """Whether something may be told now, so many hops far, which is counted as told; else it is counted as lost."""
        begin = max(self._telling_until, self._now)
        over = begin - self._now > (TELL_BURST - 1) / TELLS_A_SECOND
        if hops < 1 or over:
            self.lost += 1
            if not self._told_less:
                self._told_less = True
                self._report(TELLS_TOO_OFTEN if hops >= 1 else TELLS_TOO_FAR, ())
            return False
        self._told_less &= begin > self._now
        self._telling_until = begin + 1.0 / TELLS_A_SECOND
        return True

    def _tell(self, text: str, hops: int) -> None:
        self._say(Kind.COMMAND, text=text, deadline=self._now + TELL_SECONDS, body={HOPS: hops})

    def _ping(self, caste: float) -> None:
        if len(self.pings) < MAX_OUTBOX:
            self.pings.append(caste)
        else:
            self.lost += 1

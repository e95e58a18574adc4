"""A mind's hold on its body: STOP, RELEASE, a body that nobody drives any more, and one that sleeps."""

from __future__ import annotations

from sleepcast.channel.message import Message
from sleepcast.channel.payload import age_of, is_addressed
from sleepcast.channel.stop_latch import ENDED
from sleepcast.core.errors import SleepcastError
from sleepcast.language.vocabulary import FROZEN, SLEEPING
from sleepcast.mind.authority import Authority
from sleepcast.node.memory import RobotMemory
from sleepcast.node.speech import Speaker
from sleepcast.robot import Robot


class Embodied(Speaker):
    """A voice with a body and the memory that moves it. body: stopped, released and held still if it is a `Robot`.

    stopped: whether a STOP holds; doubt: why it stands although no STOP may have come, "" otherwise; authority: whose
    orders count.
    """

    _memory: RobotMemory

    def __init__(self, name: str, body: object | None) -> None:
        super().__init__(name)
        self.body, self.stopped, self.doubt, self.authority = body, False, "", Authority()
        self._was_still = False

    @property
    def driven(self) -> bool:
        """Whether the body was last moved by a person's command that counts once; see `deadman`."""
        return self._memory.driven

    def halt(self, doubt: str = "") -> None:
        """Stop, and stay so until RELEASE. doubt: see the class. Raises LinkError if not everything came to rest."""
        self.stopped, self.doubt = True, doubt
        if isinstance(self.body, Robot):
            self.body.stop()
        else:
            self._memory.held = True
        self._memory.variables.stop()

    def _stop(self, message: Message) -> None:
        if not self.authority.may_stop(message, self._now):
            self._answer(message, "fault", fault=ENDED)
            return
        fault = ""
        try:
            self.halt()
        except SleepcastError as error:
            fault = str(error)
        if is_addressed(message.body, self.name):  # whoever hears a STOP stops; the others need not say so again
            self._answer(message, "stopped", fault=fault)

    def _release(self, message: Message) -> None:
        if self.doubt and message.issued < age_of(
            message.body
        ):  # it may have been sent before a STOP that is forgotten
            self._answer(message, "fault", fault=f"{self.doubt}: a RELEASE from before the start does not end that")
            return
        if not self.authority.may_release(message):
            self._answer(message, "fault", fault=self.authority.latch.refusal())
            return
        self.stopped = self._memory.held = False
        self.doubt = ""
        self._memory.variables.release()
        if isinstance(self.body, Robot):
            self.body.release()
        self._answer(message, "released")

    def _let_go(self) -> None:
        """Whoever drove the body is gone: it comes to rest, and nothing that was asked goes on by itself."""
        memory = self._memory
        memory.driven = False
        memory.actuated.clear()
        if self.stopped:
            return
        if isinstance(self.body, Robot):
            self.body.stop()
            self.body.release()
        try:
            memory.variables.stop()
            memory.variables.release()
        except SleepcastError as error:
            self._report(f"nobody drives it any more, and it does not rest: {error}", ())
        else:
            self._report("at rest: nobody drives it any more", ())

    def _hold(self) -> None:
        """A sleeping or frozen robot keeps its body still."""
        values = self._memory.values
        still = values[SLEEPING] > 0 or values[FROZEN] > 0
        if still != self._was_still:
            self._was_still = still
            if isinstance(self.body, Robot):
                self.body.hold(still)

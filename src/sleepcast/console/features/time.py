"""Time on the page: how fast it runs, a single tick, another moment of a recording, or of a run that goes on."""

from __future__ import annotations

from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.feature import answers
from sleepcast.console.incoming import MAX_FACTOR, MIN_FACTOR, PageMessage

Moment = Annotated[float, Meta(ge=0.0, le=1e9)]
"""s of the run."""
NO_TIMELINE = "There is no timeline here: nothing is kept of what was."


class SetPace(PageMessage, tag="pace"):
    """How time is to run; what is None stays as it is. factor: simulated seconds in a second."""

    running: bool | None = None
    factor: Annotated[float, Meta(ge=MIN_FACTOR, le=MAX_FACTOR)] | None = None


class SingleStep(PageMessage, tag="step"):
    """One tick, then stand still."""


class Seek(PageMessage):
    """Go to this time (s) of a recording."""

    time: Moment


class ShowMoment(PageMessage, tag="look"):
    """Show this page how everything was at this time (s) of the run; None: how it is now. number: counts these of one
    page, which knows by it what a `Span` that was on its way cannot yet tell of."""

    time: Moment | None = None
    number: Annotated[int, Meta(ge=0, le=1_000_000_000)] = 0


class ShowAlternate(PageMessage, tag="ghosts"):
    """Whether to show this page where the robots were in the other future."""

    on: bool


class PacedSource(Protocol):
    """Frames of something whose time can be governed; see `Driver`."""

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None: ...

    def step(self) -> None: ...


class PacedDesk(Protocol):
    """A desk whose time can be governed."""

    @property
    def driver(self) -> PacedSource: ...


class Recorded(Protocol):
    """A recording."""

    def seek(self, time: float) -> None:
        """Go to a time, s."""


class LookingPage(Protocol):
    """A page that may look at another time than now."""

    def look_at(self, time: float | None, number: int) -> None:
        """Look at another time, s; None is now. number: to be told with what is looked at. Raises MisuseError where
        nothing is kept of it."""

    def show_alternate(self, on: bool) -> None:
        """Whether to show where the robots were in the other future."""


@answers()
def set_pace(source: PacedDesk, asked: SetPace) -> None:
    """Let time run, or stand still, or change how fast it runs."""
    source.driver.set_pace(asked.running, asked.factor)


@answers()
def single_step(source: PacedDesk, asked: SingleStep) -> None:
    """One tick, then stand still."""
    source.driver.step()


@answers(lacking="Time cannot go back in a running swarm: record the run, and replay it.")
def seek(source: Recorded, asked: Seek) -> None:
    """Go to a time of a recording."""
    source.seek(asked.time)


@answers(lacking=NO_TIMELINE)
def look_at(source: LookingPage, asked: ShowMoment) -> None:
    """Look at another time."""
    source.look_at(asked.time, asked.number)


@answers(lacking=NO_TIMELINE)
def show_alternate(source: LookingPage, asked: ShowAlternate) -> None:
    """Show the other future, or not."""
    source.show_alternate(asked.on)

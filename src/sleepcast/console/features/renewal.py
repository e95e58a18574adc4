"""Another run on the same page, and one that goes on from another moment: what may be chosen, and how it is asked for.

`console/renewal` puts the one in the place of the other.
"""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Annotated, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.console.view import ShownSlider

NOT_HERE = "This run cannot be followed by another one from its page: start it again where it was started."
MAX_VALUES = 24
"""Numbers of a scenario that a page may change at once: as many as it may have sliders."""
ScenarioName = Annotated[str, Meta(max_length=500)]
SliderName = Annotated[str, Meta(max_length=32)]
Seed = Annotated[str, Meta(pattern=r"\A[0-9]{1,19}\Z")]
"""As text: JavaScript's numbers are not exact that far."""


class Scenarios(PageMessage):
    """Which scenarios there are, and what the run on the page was made of."""

    serial: Serial


class GetSetup(PageMessage, tag="setup"):
    """What may be changed of a scenario."""

    serial: Serial
    scenario: ScenarioName


class Renew(PageMessage):
    """Start another run.

    scenario: "" for the run on the page as it was at its start; the rest is left out then
    seed, robots: None for the scenario's own
    values: by the names of sliders, each in the slider's unit
    """

    serial: Serial
    scenario: ScenarioName = ""
    seed: Seed | None = None
    robots: Annotated[int, Meta(ge=1, le=10_000_000)] | None = None
    values: Annotated[dict[SliderName, float], Meta(max_length=MAX_VALUES)] = msgspec.field(default_factory=dict)


class Fork(PageMessage):
    """Let the run go on from how it was at this time (s); what came after that becomes another future."""

    serial: Serial
    time: Annotated[float, Meta(ge=0.0, le=1e9)]


class ShownScenario(msgspec.Struct, frozen=True):
    """A scenario that may be run. name: by which it is asked for."""

    name: str
    title: str


class Offered(DeskMessage):
    """The scenarios; current: that of the run on the page."""

    serial: int
    scenarios: list[ShownScenario]
    current: str


class Choices(msgspec.Struct, frozen=True):
    """What may be changed of a scenario, with the values of the run on the page, if that is of this scenario. fixed:
    whether its robots are as many as they are."""

    seed: str
    robots: int
    fixed: bool
    sliders: list[ShownSlider]


class SetUp(DeskMessage):
    """The answer to `GetSetup`."""

    serial: int
    choices: Choices


class Renewed(DeskMessage):
    """There is another run: load the page again. serial: of the question, if there was one."""

    serial: int | None = None


class RenewalSource(Protocol):
    """A run that another one may follow. All raise SleepcastError."""

    def scenarios(self, asked: Scenarios) -> Awaitable[Offered]: ...

    def choices(self, asked: GetSetup) -> Awaitable[SetUp]: ...

    def renew(self, asked: Renew) -> Awaitable[Renewed]: ...

    def fork(self, asked: Fork) -> Awaitable[Renewed]: ...


@answers(lacking=NOT_HERE)
def scenarios(source: RenewalSource, asked: Scenarios) -> Awaitable[Offered]:
    """Which scenarios there are."""
    return source.scenarios(asked)


@answers(lacking=NOT_HERE)
def choices(source: RenewalSource, asked: GetSetup) -> Awaitable[SetUp]:
    """What may be changed of one."""
    return source.choices(asked)


@answers(lacking=NOT_HERE)
def renew(source: RenewalSource, asked: Renew) -> Awaitable[Renewed]:
    """Start another run."""
    return source.renew(asked)


@answers(lacking=NOT_HERE)
def fork(source: RenewalSource, asked: Fork) -> Awaitable[Renewed]:
    """Let the run go on from another moment."""
    return source.fork(asked)

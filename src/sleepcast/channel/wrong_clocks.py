"""Clocks that are wrong: whose differ from ours by more than is allowed, and sentences that say so.

What is noted here was signed, and is no replay: whoever notes it has seen to that.
"""

from __future__ import annotations

from collections.abc import Sequence

MAX_CLOCKS = 1_000_000
"""Parties whose clocks are known: as many as a roster takes."""
ALIKE = 4.0
"""Seconds by which clocks may differ that are wrong together: each of them may be wrong by the skew."""
SHOWN = 5
"""Names in a sentence; of more, their number."""
UNITS = ((2 * 365.25 * 86_400.0, 365.25 * 86_400.0, "years"), (2 * 86_400.0, 86_400.0, "days"), (0.0, 1.0, "s"))
"""From how many seconds on a difference is told in which unit."""


class WrongClocks:
    """See the module. What is kept of each party: by how many s its clock is ahead of ours, 0 for one that is right."""

    def __init__(self) -> None:
        self._ahead: dict[str, float] = {}
        self._took: dict[str, tuple[str, float]] = {}

    def note(self, name: str, ahead: float) -> None:
        """The clock of this party is so many s ahead; 0 where it is right."""
        if ahead or name in self._ahead or len(self._ahead) < MAX_CLOCKS:
            self._ahead[name] = ahead

    def note_took(self, name: str, whose: str, behind: float) -> None:
        """This robot had a clock that was so many s behind, and has taken its time from another party."""
        if name in self._took or len(self._took) < MAX_CLOCKS:
            self._took[name] = whose, behind
        self.note(name, 0.0)

    def clear(self) -> None:
        """Nothing is known any more."""
        self._ahead.clear()
        self._took.clear()

    def ahead(self, name: str) -> float:
        """By how many s its clock is ahead; 0 where that is not known."""
        return self._ahead.get(name, 0.0)

    @property
    def wrong(self) -> dict[str, float]:
        """Those that are wrong."""
        return {name: ahead for name, ahead in self._ahead.items() if ahead}

    def of_robots(self, life: float) -> list[str]:
        """What an operator has to know of the clocks of robots. life: s for which commands count."""
        found, wrong = [], sorted(self.wrong.items(), key=lambda each: each[1])
        if len(wrong) > 1:
            middle = wrong[len(wrong) // 2][1]
            alike = [name for name, ahead in wrong if abs(ahead - middle) <= ALIKE]
            if 2 * len(alike) > max(2, len(self._ahead)):  # more likely one clock is wrong than so many
                rest = "they obey nothing but your STOP; set it, and start sleepcast again"
                found.append(
                    f"your clock is {differs(-middle)} {'of ' if middle < 0 else ''}{len(alike)} robots: {rest}"
                )
                wrong = [(name, ahead) for name, ahead in wrong if name not in alike]
        while wrong:
            first = wrong[0][1]
            names = [name for name, ahead in wrong if ahead - first <= ALIKE]
            whose = "its clock is" if len(names) == 1 else "their clocks are"
            only = "" if 0.0 < first <= life else "; it obeys STOP only" if len(names) == 1 else "; they obey STOP only"
            found.append(f"{_listed(names)}: {whose} {differs(first)}{only}")
            wrong = wrong[len(names) :]
        return found + self._taken()

    def _taken(self) -> list[str]:
        """Who has taken the time from whom, those alike in one sentence."""
        alike: dict[tuple[str, str], list[str]] = {}
        for name, (whose, behind) in self._took.items():
            alike.setdefault((whose, differs(-behind)), []).append(name)
        return [took(names, *which) for which, names in alike.items()]

    def of_operators(self) -> list[str]:
        """What a robot tells of its clock, by those of the operators."""
        return [
            f"our clock is {differs(-ahead)} {'of ' if ahead < 0 else ''}that of {name}: nothing but STOP is obeyed"
            for name, ahead in self.wrong.items()
        ]


def differs(ahead: float) -> str:
    """By how much a clock is wrong, for a person: `3,600 s ahead`."""
    _, unit, name = next(each for each in UNITS if abs(ahead) >= each[0])
    return f"{abs(ahead) / unit:,.0f} {name} {'ahead' if ahead > 0.0 else 'behind'}"


def took(names: Sequence[str], whose: str, differs: str) -> str:
    """Robots have taken the time from somebody, as a sentence. differs: by how much they were wrong."""
    theirs, clocks = ("its", "its clock was") if len(names) == 1 else ("their", "their clocks were")
    return f"{_listed(names)} took {theirs} time from {whose}: {clocks} {differs}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more

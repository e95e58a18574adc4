"""Times of day, as people give them: `12:30:05` is the next moment at which clocks here show that."""

from __future__ import annotations

import re
from datetime import datetime, timedelta

from sleepcast.core.ages import duration
from sleepcast.core.errors import MisuseError

_WRITTEN = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d{1,6})?))?", re.ASCII)


def instant_of(text: str, now: float, within: float) -> float:
    """The next moment after `now` at which it is this time of day here; both in s of Unix time. Raises MisuseError,
    also for one that is more than `within` s ahead."""
    written = _WRITTEN.fullmatch(text.strip())
    hour, minute, second = (float(each or 0.0) for each in written.groups()) if written else (24.0, 0.0, 0.0)
    if hour >= 24.0 or minute >= 60.0 or second >= 60.0:
        raise MisuseError(f"a time of day of {text!r:.40}: wanted hours, minutes and seconds, such as 12:30:05")
    day = datetime.fromtimestamp(now).replace(hour=0, minute=0, second=0, microsecond=0)
    passed = timedelta(hours=hour, minutes=minute, seconds=second)
    moments = [(day + timedelta(days=days) + passed).timestamp() for days in (-1, 0, 1)]
    before, after = max(each for each in moments if each <= now), min(each for each in moments if each > now)
    if after - now > within:
        was = f"was {duration(now - before)} ago, and next " if now - before < after - now else ""
        when = f"{text.strip()} {was}is in {duration(after - now)}"
        raise MisuseError(f"{when}: wanted one within the next {duration(within)}")
    return after


def time_of_day(moment: float) -> str:
    """`12:30:05.2` here, of a moment in s of Unix time."""
    shown = datetime.fromtimestamp(moment).strftime("%H:%M:%S.%f")[:-5]
    return shown.removesuffix(".0")

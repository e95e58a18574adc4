"""Addresses of bodies: `SCHEME://HOST:PORT?SETTING=VALUE&...#PART`, or `SCHEME:///PATH?SETTING=VALUE&...` where names
need no host. An error says what was wanted."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from urllib.parse import parse_qsl, urlsplit

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.records import dataclass

MAX_URI = 1_000
"""Characters of an address: more than names, settings and their values need."""
MAX_SETTINGS = 64


class BodyError(MisuseError):
    """A URI that leads to no body."""


@dataclass(frozen=True, slots=True)
class BodyAddress:
    """Where a body is.

    port: None if not given.
    part: what stands behind #.
    settings: those given, and the defaults of the others.
    path: with its slash, of an address without a host.
    """

    uri: str
    host: str
    port: int | None
    part: str
    settings: Mapping[str, str]
    path: str = ""

    def number(self, key: str, least: float = 0.0, most: float = inf, unit: str = "") -> float:
        """A setting that is a number above `least`, or `most` at most. Raises BodyError."""
        try:
            number = float(self.settings[key])
        except ValueError:
            number = least
        if not least < number <= most:
            bounds = f"a number above {least:g}" + (f" and up to {most:g}" if most < inf else "")
            what = f"{key} is {bounds}{unit and f', in {unit}'}, not {self.settings[key]!r:.40}"
            raise BodyError(f"{self.uri!r:.100}: {what}")
        return number

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """A setting that is one of these. Raises BodyError."""
        chosen = self.settings[key]
        if chosen not in choices:
            known = f"{did_you_mean(chosen, choices)}; there are {', '.join(choices)}"
            raise BodyError(f"{self.uri!r:.100}: there is no {key} {chosen!r:.40}{known}")
        return chosen


def read_body_address(uri: str, example: str, settings: Mapping[str, str], *, by_path: bool = False) -> BodyAddress:
    """An address in its parts. Raises BodyError.

    example: one that is right, for errors.
    settings: those that may stand behind the question mark, with their defaults.
    by_path: whether it has a path and no host.
    """
    wanted = f"wanted something like {example}"
    if len(uri) > MAX_URI:
        raise BodyError(f"{uri!r:.80}... is too long; {wanted}")
    try:
        parts = urlsplit(uri)
        port = parts.port
        given = parse_qsl(parts.query, keep_blank_values=True, max_num_fields=MAX_SETTINGS)
    except ValueError as error:
        raise BodyError(f"{uri!r:.100} leads nowhere ({error}); {wanted}") from None
    if by_path and (parts.netloc or parts.fragment or not parts.path.startswith("/")):
        raise BodyError(f"{uri!r:.100} has a host, or no path; {wanted}")
    if not by_path and (parts.path not in ("", "/") or not parts.hostname):
        raise BodyError(f"{uri!r:.100} has no host, or more than one; {wanted}")
    values = dict(settings)
    for key, text in given:
        if key not in settings:
            known = f"{did_you_mean(key, settings)}; there are {', '.join(settings)}"
            raise BodyError(f"{uri!r:.100}: there is no setting {key!r:.40}{known}")
        values[key] = text
    return BodyAddress(uri, parts.hostname or "", port, parts.fragment, values, parts.path if by_path else "")

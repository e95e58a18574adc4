"""`sleepcast demo` and `sleepcast run`: a scenario brought to life, on a page or headless."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from typing import TYPE_CHECKING, Any, TypeVar

import click

from sleepcast.cli.streams import put
from sleepcast.errors import MisuseError

if TYPE_CHECKING:
    from sleepcast.simulator import Scenario

MAX_PORT = 65_535
Command = TypeVar("Command", bound=Callable[..., int])

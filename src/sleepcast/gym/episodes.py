"""Which episode of a task is running, and which one is next.

The same seed with the same number of an episode is the same run, bit for bit, whatever came before.
"""

from __future__ import annotations

from collections.abc import Mapping
from secrets import randbits
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.given_numbers import MAX_SEED, read_seed, whole_number
from sleepcast.gym.episode import Episode, EpisodeStep
from sleepcast.gym.task import CheckedTask


class EpisodeKey(NamedTuple):
    """seed: what `reset` was given. episode: how many episodes of that seed came before, from 0."""

    seed: int
    episode: int


class Episodes:
    """One episode of a task after the other. key: that of the one that began last, None before the first. ended:
    whether the one that runs has reached its goal or its time."""

    def __init__(self, task: CheckedTask) -> None:
        self.task = task
        self.key: EpisodeKey | None = None
        self.ended = False
        self._current: Episode | None = None

    def begin(self, seed: int | None, options: Mapping[str, Any] | None) -> Episode:
        """Begin the first episode of a seed, or the one that options["episode"] names; without both, the next one of
        the same seed. The first seed is drawn by the system if none is given, as Gymnasium has it: copies of an
        environment would otherwise repeat each other. Raises MisuseError."""
        self.key = _following(self.key, seed, _episode_in(options))
        self.close()
        self._current = Episode(self.task, *self.key)
        return self._current

    def running(self) -> Episode:
        """Raises MisuseError if none has begun."""
        if self._current is None:
            raise MisuseError("no episode has begun: call reset() first")
        return self._current

    def step(self, actions: NDArray[np.generic]) -> EpisodeStep:
        """See `Episode.step`. Raises MisuseError if none has begun."""
        made = self.running().step(actions)
        self.ended = made.ended or made.over
        return made

    def close(self) -> None:
        self.ended = False
        if self._current is not None:
            self._current.close()
            self._current = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy, in this process or another, begins anew."""
        return {"task": self.task, "key": None, "ended": False, "_current": None}


def _following(key: EpisodeKey | None, seed: int | None, episode: int | None) -> EpisodeKey:
    if seed is not None:
        return EpisodeKey(read_seed(seed), episode or 0)
    if key is None:
        return EpisodeKey(randbits(32), episode or 0)
    return EpisodeKey(key.seed, key.episode + 1 if episode is None else episode)


def _episode_in(options: Mapping[str, Any] | None) -> int | None:
    """The one of our options; others may be for what wraps the environment, unless they are ours misspelt."""
    for name in options or ():
        if name != "episode" and (meant := did_you_mean(str(name), ["episode"])):
            raise MisuseError(f'reset: no option "{name!s:.40}"{meant}')
    episode = (options or {}).get("episode")
    return None if episode is None else whole_number(episode, "reset: episode", 0, MAX_SEED)

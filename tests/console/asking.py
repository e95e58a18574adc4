"""What a page asks a desk, without a page: the answer comes back, and a refusal is raised."""

from __future__ import annotations

from typing import Any

from sleepcast.console import registry
from sleepcast.console.incoming import PageMessage


def put(source: Any, question: type[PageMessage], *fields: Any, **more: Any) -> Any:
    """What a desk (or an open page) answers to a question with these fields."""
    return registry.answer(question(*fields, **more), source)

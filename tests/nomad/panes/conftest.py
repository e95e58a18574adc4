"""Fixtures of the console's tests that those of its pages of Nomads share."""

from console.conftest import chromium, context, playwright

__all__ = ["chromium", "context", "playwright"]

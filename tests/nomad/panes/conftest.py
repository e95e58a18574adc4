"""Fixtures of the console's tests that those of its pages of Nomads share."""

from console.conftest import chromium, context, kept_chromium

__all__ = ["chromium", "context", "kept_chromium"]

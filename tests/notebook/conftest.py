"""A real Chromium, as the console's tests have it."""

from console.conftest import chromium, context, playwright

__all__ = ["chromium", "context", "playwright"]

"""A real Chromium, as the console's tests have it."""

from console.conftest import chromium, context, kept_chromium

__all__ = ["chromium", "context", "kept_chromium"]

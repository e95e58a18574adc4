"""How hypothesis searches: the same examples every time in an ordinary run, fresh and more of them at night.

`python3 go.py test --hypothesis-profile nightly` runs the night's profile. No deadline for an example: a busy
machine is no bug, and what must be fast is measured in a test of its own.
"""

from hypothesis import settings

settings.register_profile("ordinary", deadline=None, derandomize=True, print_blob=True)
settings.register_profile("nightly", deadline=None, max_examples=10_000, print_blob=True)
settings.load_profile("ordinary")

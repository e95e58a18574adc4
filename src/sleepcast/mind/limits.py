"""Bounds of one robot's mind in a fleet: the same as of a mind of its own, because robots must not behave otherwise
for being many (a test compares them with those of `node`)."""

from __future__ import annotations

MAX_FAULTS = 100
"""Faults kept of one evaluation: more would only repeat what the first ones say."""
PROVEN_TICKS = 100
"""Ticks that a rule set must have run without a fault for ROLLBACK to come back to it."""
MAX_RECOLLECTIONS = 4_096
"""Commands whose inputs a fleet keeps at most, to explain them later: many are heard by a few robots only, because
robots tell each other. What they take is bounded by `RECALL_BYTES`."""
MAX_QUEUE = 64
"""Messages waiting for the next tick on one robot; more are dropped and counted."""
MAX_SEEN = 1_024
"""Message ids remembered so that a repeated message changes nothing."""
MAX_OUTBOX = 256
"""Things said by one robot in one tick; the rest is dropped and counted."""
REPORTS_A_SECOND = 20
"""Reports of one robot that go on the air in a second of its clock."""
FAILED = 1 << 62
"""The tick since which a rule set is unproven that has failed: after all others, until somebody changes the set."""
MAX_FAULTS_IN_ROW = 10
"""Evaluations with a fault, one after the other, after which a rule is deactivated."""
TELLS_A_SECOND = 2.0
"""What one robot may tell others in a second, in the long run."""
TELL_BURST = 8
"""What it may tell at once after some quiet."""
TELLS_TOO_OFTEN = f"tells too often: more than {TELLS_A_SECOND:g} a second are dropped"
TELLS_TOO_FAR = "did not tell on what came by its last hop"
"""What it reports when it does not tell something."""
TELL_SECONDS = 5.0
"""How long what a robot tells others may still be acted on."""
TICK_STEPS = 50_000
"""Steps that one robot's rules may use in one tick."""

RECALL_BYTES = 256
"""Bytes a robot for the inputs of past commands: a quarter of the kilobyte that a robot's mind may take."""
RECALL_LEAST = 4 * 1024 * 1024
"""Bytes for them in a small fleet, where nobody counts."""
MEMO_BYTES = 2_048
"""About what a command's inputs take besides their columns."""
SPARE_MINDS = 256
"""Minds that no robot is of any more, before they are looked for and forgotten."""

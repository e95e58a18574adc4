"""Bounds of one robot's mind: the same for a single robot and for one of a million, because their number must not
change what robots do."""

from __future__ import annotations

MAX_QUEUE = 64
"""Messages waiting for the next tick; more are dropped and counted, as a radio drops what it has no room for."""
MAX_SEEN = 1_024
"""Message ids remembered so that a repeated message changes nothing."""

TICK_STEPS = 50_000
"""Steps that one robot's rules may use in one tick: ten milliseconds of a slow computer, a tenth of a 10 Hz tick."""
MAX_FAULTS = 100
"""Faults kept of one evaluation: more would only repeat what the first ones say."""
MAX_FAULTS_IN_ROW = 10
"""Evaluations with a fault, one after the other, after which a rule is deactivated."""
PROVEN_TICKS = 100
"""Ticks that a rule set must have run without a fault for ROLLBACK to come back to it."""
FAILED = 1 << 62
"""The tick since which a rule set is unproven that has failed: after all others, until somebody changes the set."""

MAX_OUTBOX = 256
"""Things said in one tick; the rest is dropped and counted."""
REPORTS_A_SECOND = 20
"""Reports of one robot that go on the air in a second of its clock: a rule that speaks at every tick is heard."""
TELL_SECONDS = 5.0
"""How long what a robot tells others may still be acted on."""
TELLS_A_SECOND = 2.0
"""What one robot may tell others in a second, in the long run: a thousand of them share one radio."""
TELL_BURST = 8
"""What it may tell at once after some quiet."""
TELLS_TOO_OFTEN = f"tells too often: more than {TELLS_A_SECOND:g} a second are dropped"
TELLS_TOO_FAR = "did not tell on what came by its last hop"
"""What it reports, once until it has been quiet, when it does not tell something."""

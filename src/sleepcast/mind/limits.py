"""Bounds of one robot's mind: the same for a single robot and for one of a million, because the number of robots must
not change what they do."""

from __future__ import annotations

MAX_QUEUE = 64
"""Messages waiting for the next tick; more are dropped and counted, as a radio drops what it has no room for."""
MAX_BACKLOG = 4_096
"""The same limit on a real channel, where a missing message arrives together with all that waited for it: the size of
the window of a sender's numbers. One tick still evaluates no more messages than elsewhere."""
MAX_QUESTIONS = 64
"""Questions of one sender that wait, on a real channel; more are refused."""
ASKS_TOO_MUCH = f"not answered: {MAX_QUESTIONS} questions of yours wait already; ask again more slowly"
"""The fault of a question that finds no room."""
MAX_SEEN = 1_024
"""Message ids remembered so that a repeated message changes nothing."""

QUESTIONS_SHARE = 0.25
"""Share of the time of one process that the questions of one sender may take in the long run, all robots together."""
ALL_QUESTIONS_SHARE = 0.5
"""The same of all senders together: rules and commands have the rest."""
COMMANDS_SHARE = 1.0
"""The same for the commands of one operator, or for all that robots tell."""
TELLS_SHARE = 0.25
"""The same for what one robot tells."""
SECONDS_AT_ONCE = 0.2
"""Seconds that one sender may take at once, and all together twice as much, after a while in which they took less: a
question to a thousand robots of one process takes some tenth of it."""

TICK_STEPS = 50_000
"""Steps that one robot's rules may use in one tick: ten milliseconds on a slow computer, a tenth of a 10 Hz tick."""
MAX_FAULTS = 100
"""Faults recorded of one evaluation: more would only repeat the first ones."""
MAX_FAULTS_IN_ROW = 10
"""Consecutive evaluations with a fault after which a rule is deactivated."""
PROVEN_TICKS = 100
"""Ticks without a fault after which a rule set is proven, so that ROLLBACK can restore it."""
FAILED = 1 << 62
"""Stands for the start of the unproven time of a rule set that has failed: later than any tick, until the set is
changed."""

MAX_OUTBOX = 256
"""Messages sent in one tick; the rest is dropped and counted."""
REPORTS_A_SECOND = 20
"""Reports of one robot per second of its clock: enough for a rule that reports at every tick."""
TELL_SECONDS = 5.0
"""Seconds after which what a robot tells others expires."""
TELLS_A_SECOND = 2.0
"""Tells of one robot per second in the long run: a thousand robots share one radio."""
TELL_BURST = 8
"""Tells that a robot may send at once after a pause."""
MAX_CALLS = 8
"""Auctions that one robot calls by TELL at once: as many as another robot bids for of one caller."""
TOO_MANY_CALLS = f"it collects bids for {MAX_CALLS} TELLs at once: no more"
TELLS_TOO_OFTEN = f"tells too often: more than {TELLS_A_SECOND:g} a second are dropped"
TELLS_TOO_FAR = "did not tell on what came by its last hop"
"""Reported when a robot refuses to tell something, only once until it has been below its rate again."""

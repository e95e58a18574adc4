#!/bin/sh
# Which of two signing MAVLink parties pymavlink refuses if the clock of the first one is an hour ahead.
#
# Installs a pinned pymavlink in a temporary folder; nothing of sleepcast runs. Needs python3 with venv, and the network.
# All three have the same key, and the receiver and the second party have the right time. One would guess that both are
# heard, or that the first one is refused. As of pymavlink 2.4.50:
#
#   ahead     heard; the receiver's own time becomes that of the first party
#   right     refused: a newcomer's timestamp must be at most a minute behind the greatest one ever received
#
# Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
cat > parties.py << 'SCRIPT'
import hashlib
import time

from pymavlink.dialects.v20 import common

KEY, STEPS = hashlib.sha256(b"a phrase of all three").digest(), 100_000


def party(system, ahead=0):
    found = common.MAVLink(None, system, 1)
    found.robust_parsing = True
    found.signing.secret_key, found.signing.sign_outgoing = KEY, True
    found.signing.timestamp = int((time.time() + ahead - 1_420_070_400) * STEPS)
    return found


receiver = party(9)
for name, sender in (("ahead", party(1, ahead=3600)), ("right", party(2))):
    data = sender.heartbeat_encode(10, 3, 129, 15, 4).pack(sender)
    (message,) = receiver.parse_buffer(bytearray(data))
    print(name, "refused" if message.get_type() == "BAD_DATA" else "heard")
SCRIPT
there/bin/python parties.py > found
cat > wanted << 'WANTED'
ahead heard
right refused
WANTED
echo "pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }

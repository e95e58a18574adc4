"""What other programs of MAVLink do, as docs/counterparts.md says."""

from __future__ import annotations

import subprocess

import pytest

import families

BURST = """
import { createRequire } from 'node:module';
const { minimal, MavLinkProtocolV2, MavLinkPacketSignature } = createRequire(process.argv[2] + '/')('node-mavlink');
const protocol = new MavLinkProtocolV2(255, 190, MavLinkProtocolV2.IFLAG_SIGNED);
const key = MavLinkPacketSignature.key('a secret');
for (let number = 0; number < 40; number++) {
    const packet = protocol.serialize(new minimal.Heartbeat(), number);
    console.log(protocol.sign(packet, 1, key).toString('hex'));
}
"""


@pytest.mark.counterpart("node-mavlink", "node")
def test_node_mavlink_signs_a_burst_with_whole_milliseconds() -> None:
    command = ["node", "--input-type=module", "-", str(families.NODE_MODULES)]
    done = subprocess.run(command, input=BURST, capture_output=True, text=True, check=True)
    packets = [bytes.fromhex(line) for line in done.stdout.split()]
    stamps = [int.from_bytes(packet[-12:-6], "little") for packet in packets]  # in tens of microseconds
    assert len(stamps) == 40
    assert all(stamp % 100 == 0 for stamp in stamps)
    assert len(set(stamps)) < 40, "forty of them take less than forty milliseconds"

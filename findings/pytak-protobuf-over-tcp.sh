#!/bin/sh
# How pytak speaks with a TAK server over TCP when it is told to use protobuf.
#
# Installs pinned pytak and takproto in a temporary folder; a small server in the same process offers protobuf as TAK servers
# do, waits, and passes on an event as XML to who has not asked for anything else. Nothing of sleepcast runs. Needs python3
# with venv, and the network. One would guess that a client with TAK_PROTO=1 answers the offer (t-x-takp-q) and begins in
# XML, as the protocol has it for streams. As of pytak 7.6.1:
#
#   TAK_PROTO=0   it begins with XML, and hands on what comes
#   TAK_PROTO=1   its first byte is that of a protobuf stream, it never asks, and nothing of what comes is handed on
#
# On multicast it needs TAK_PROTO=1 to read protobuf at all, so whoever sets it for all its connections is deaf at servers.
# Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check pytak==7.6.1 takproto==3.0.1 2> pip.log || { cat pip.log >&2; exit 1; }
cat > talk.py << 'SCRIPT'
import asyncio
import configparser
import sys

import pytak

EVENT = (
    '<event version="2.0" uid="{0}" type="{1}" how="m-g" time="2026-01-01T00:00:00Z" start="2026-01-01T00:00:00Z"'
    ' stale="2036-01-01T00:00:00Z"><point lat="1" lon="2" hae="0" ce="1" le="1"/><detail>{2}</detail></event>'
)
OFFER = EVENT.format("offer", "t-x-takp-v", '<TakControl><TakProtocolSupport version="1"/></TakControl>').encode()
OTHER = EVENT.format("other", "a-f-G", "").encode()


async def main():
    came, taken = b"", []

    async def serve(reader, writer):
        nonlocal came
        writer.write(OFFER)
        try:
            while True:
                came += await asyncio.wait_for(reader.read(65_536), 3.0)
        except asyncio.TimeoutError:
            pass
        writer.write(OTHER)
        await writer.drain()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    config = configparser.ConfigParser()
    address = f"tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    config["pytak"] = {"COT_URL": address, "TAK_PROTO": sys.argv[1]}
    tool = pytak.CLITool(config["pytak"])
    await tool.setup()

    async def take():
        while True:
            taken.append(await tool.rx_queue.get())

    taking = asyncio.create_task(take())
    await tool.tx_queue.put(pytak.gen_cot(lat=1, lon=2, uid="me"))
    try:
        await asyncio.wait_for(tool.run(), 8.0)
    except (asyncio.TimeoutError, Exception):
        pass
    taking.cancel()
    begun = "XML" if came.startswith(b"<") else "protobuf" if came.startswith(b"\xbf") else "nothing"
    asked = "asks for protobuf" if b"t-x-takp-q" in came else "asks for nothing"
    heard = any(b'uid="other"' in bytes(each) for each in taken if isinstance(each, bytes | bytearray))
    print(f"TAK_PROTO={sys.argv[1]}: begins with {begun}, {asked}, hands on {'the event' if heard else 'nothing'}")


asyncio.run(main())
SCRIPT
for proto in 0 1; do here/bin/python -W ignore talk.py $proto 2> errors.log || { cat errors.log >&2; exit 1; }; done > found
cat > wanted << 'WANTED'
TAK_PROTO=0: begins with XML, asks for nothing, hands on the event
TAK_PROTO=1: begins with protobuf, asks for nothing, hands on nothing
WANTED
echo "pytak 7.6.1, takproto 3.0.1, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }

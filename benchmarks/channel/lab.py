"""A laboratory: hosts with networks of their own on this machine, joined by a radio that loses, cuts, delays, repeats.

Each host is a network namespace with one interface, `eth0`. All of them, and the bridge that joins them, lie in a user
namespace of ours, so that nobody need be root, nothing is left of them when their last process has ended, and nothing
of this machine's own network is touched. Loss is a rule of nftables in each receiver's namespace, with chances of its
own; a host that is cut off is on a bridge without the others; delay, duplication and reordering are made by a relay
(`relay`) that takes the bridge's place. What goes over the air is counted at the bridge, once for each datagram however
many hear it, by the kind of message, which lies at a fixed place in it.

Linux only, with `ip` (iproute2), `nft` (nftables), and `unshare`, `nsenter` and `setpriv` (util-linux).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from sleepcast.channel.envelope import KINDS, PAYLOAD_AT

ROOT = Path(__file__).resolve().parents[2]
PORT = 47_123
URI = f"udp://239.255.83.76:{PORT}?interface=eth0"
"""The channel of all hosts."""
PATH = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"))
"""Where these tools are: some systems do not tell people of what they take for root's."""
TOOLS = ("ip", "nft", "unshare", "nsenter", "setpriv")
OWN_USERS = ("--user", "--map-root-user")
MAX_HOSTS = 200
PATIENCE = 60.0
"""Seconds within which the system answers, and a process ends."""
KIND_AT = 8 * (8 + PAYLOAD_AT + 2)
"""Bits from UDP's head of eight bytes to the kind of a message: the third byte of what is signed."""
TO_AIR = f"udp dport {PORT}"


class LabError(Exception):
    """A laboratory cannot be made here; the text says why."""


class Traffic(NamedTuple):
    """What was on the air: datagrams, and their bytes with the heads of IP and UDP."""

    datagrams: int = 0
    bytes: int = 0

    def since(self, before: Traffic) -> Traffic:
        return Traffic(self.datagrams - before.datagrams, self.bytes - before.bytes)


class Lab:
    """See the module. hosts: their names. Raises LabError where it cannot be made."""

    def __init__(self, hosts: Sequence[str]) -> None:
        missing = [tool for tool in TOOLS if shutil.which(tool, path=PATH) is None]
        if sys.platform != "linux" or missing:
            lacks = f"without {', '.join(missing)}" if missing else sys.platform
            raise LabError(f"wanted Linux with {', '.join(TOOLS)}, and this is {lacks}")
        if len(hosts) > MAX_HOSTS:
            raise LabError(f"at most {MAX_HOSTS} hosts, not {len(hosts)}")
        self.hosts = tuple(hosts)
        self._processes: list[subprocess.Popen[str]] = []
        self._anchor, self._enter = _anchor()
        try:
            self._links(_joined(self.hosts))
            self._nft(_METER)
            for place, host in enumerate(self.hosts):
                self._system("ip", "-n", host, "-batch", "-", say=_INSIDE.format(place + 1))
                self._nft(_EARS, host)
        except LabError:
            self.close()
            raise

    # ---- processes

    def start(
        self,
        host: str,
        *command: str | Path,
        environment: Mapping[str, str] | None = None,
        stdin: int = subprocess.DEVNULL,
        stdout: int | None = None,
        stderr: int | None = None,
    ) -> subprocess.Popen[str]:
        """A process on a host; it ends with ours, whatever becomes of us."""
        there = ("ip", "netns", "exec", host, "setpriv", "--pdeathsig", "KILL", "--")
        process = subprocess.Popen(
            [*self._enter, *there, *command],
            cwd=ROOT,
            env={**(os.environ if environment is None else environment), "PATH": PATH},
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            text=True,
        )
        self._processes.append(process)
        return process

    def stop(self, process: subprocess.Popen[str], signal: int) -> int:
        """Send a signal to a process, and wait for its end; gives its exit status."""
        process.send_signal(signal)
        return process.wait(PATIENCE)

    def close(self) -> None:
        """End every process; the networks go with the last of them."""
        for process in (*self._processes, self._anchor):
            process.kill()
        for process in (*self._processes, self._anchor):
            process.wait(PATIENCE)
            for stream in (process.stdin, process.stdout, process.stderr):
                if stream is not None:
                    stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    # ---- the air

    def lose(self, share: float, hosts: Iterable[str] | None = None, what: str = TO_AIR) -> None:
        """From now on each of these hosts (or all) loses this share of what reaches it, each by its own chance. what:
        that can be lost, as nftables has it."""
        rule = f"add rule inet radio ears {what} numgen random mod 1000 < {round(1_000 * share)} drop\n"
        for host in self.hosts if hosts is None else hosts:
            self._nft("flush chain inet radio ears\n" + (rule if share > 0.0 else ""), host)

    def cut(self, *hosts: str) -> None:
        """These hosts hear each other only, and nobody else hears them."""
        self._links([f"link set {_port(self.hosts.index(host))} master away" for host in hosts])

    def heal(self, *hosts: str) -> None:
        """These hosts, or all, hear everybody again and are heard, but for those that are still cut off."""
        self._links([f"link set {_port(self.hosts.index(host))} master air" for host in hosts or self.hosts])

    def disturb(self, delay: float, twice: float, seed: int) -> subprocess.Popen[str]:
        """From now on everything reaches each of the others after a time of its own, up to `delay` s, so also out of
        order, and the share `twice` of it two times; nothing is counted any more. Gives the relay that does it."""
        ports = [_port(place) for place in range(len(self.hosts))]
        self._links([f"link set {port} nomaster" for port in ports])
        options = ("--delay", str(delay), "--twice", str(twice), "--seed", str(seed))
        command = [*self._enter, sys.executable, "-m", "benchmarks.channel.relay", *options, *ports]
        relay = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "PATH": PATH},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._processes.append(relay)
        assert relay.stdout is not None
        if relay.stdout.readline() != "ready\n":
            raise LabError("the relay does not begin")
        return relay

    def end(self, relay: subprocess.Popen[str]) -> dict[str, int]:
        """End a relay, after which nobody hears anybody; gives what it has counted."""
        counts, _ = relay.communicate(timeout=PATIENCE)
        found: dict[str, int] = json.loads(counts)
        return found

    def traffic(self) -> dict[str, Traffic]:
        """What has been on the air since the beginning, by the kind of message; kinds that were not are left out."""
        told = json.loads(self._system("nft", "-j", "list", "counters"))["nftables"]
        counters = [each["counter"] for each in told if "counter" in each]
        return {each["name"]: Traffic(each["packets"], each["bytes"]) for each in counters if each["packets"]}

    # ---- the system

    def _links(self, lines: Sequence[str]) -> None:
        self._system("ip", "-batch", "-", say="\n".join(lines) + "\n")

    def _nft(self, rules: str, host: str | None = None) -> None:
        there = () if host is None else ("ip", "netns", "exec", host)
        self._system(*there, "nft", "-f", "-", say=rules)

    def _system(self, *command: str, say: str = "") -> str:
        """What the system answers to a command in the laboratory. Raises LabError if it refuses."""
        done = subprocess.run(
            [*self._enter, *command],
            env={**os.environ, "PATH": PATH},
            input=say,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        if done.returncode:
            raise LabError(f"{' '.join(command)}: {done.stderr.strip() or done.returncode}")
        return done.stdout


def _anchor() -> tuple[subprocess.Popen[str], tuple[str, ...]]:
    """A process that holds the namespaces, and the words before a command that is to run in them. Raises LabError."""
    said = ""
    for users in (OWN_USERS, ()):  # root alone may do without users of its own, where a machine refuses these
        command = ["unshare", *users, "--net", "--mount", "sh", "-ec", _HOLD]
        anchor = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "PATH": PATH},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert anchor.stdin is not None
        assert anchor.stdout is not None
        assert anchor.stderr is not None
        if anchor.stdout.readline() == "ready\n":
            where = ("--user", "--preserve-credentials") if users else ()
            return anchor, ("nsenter", "--target", str(anchor.pid), *where, "--net", "--mount", "--wd", "--")
        said = said or anchor.stderr.read().strip()
        anchor.wait(PATIENCE)
        for stream in (anchor.stdin, anchor.stdout, anchor.stderr):
            stream.close()
    raise LabError(f"this machine lets us have no network namespaces: {said}")


@cache
def why_not() -> str:
    """Why no laboratory can be made here, "" if one can: to try it takes seven processes and a tenth of a second."""
    try:
        Lab(["one", "two"]).close()
    except LabError as error:
        return str(error)
    return ""


def _port(place: int) -> str:
    """The name of the end at the bridge of a host's cable."""
    return f"port{place}"


def _joined(hosts: Sequence[str]) -> list[str]:
    """Commands of `ip` that make the hosts and join them."""
    lines = ["link set lo up"]
    for bridge in ("air", "away"):  # what it does not know goes everywhere, as on a radio
        lines += [f"link add {bridge} type bridge mcast_snooping 0", f"link set {bridge} up"]
    for place, host in enumerate(hosts):
        lines += [
            f"netns add {host}",
            f"link add {_port(place)} type veth peer name eth0 netns {host}",
            f"link set {_port(place)} master air up",
        ]
    return lines


_HOLD = "mount -t tmpfs none /run; mkdir /run/netns; echo ready; exec cat"
"""Names of namespaces are kept in /run, which is therefore our own here; what we are told on standard input ends us."""
_NAMES = (*KINDS, "standing")
_METER = (
    "table bridge radio {\n"
    + "".join(f"counter {name} {{}}\n" for name in _NAMES)
    + "chain air { type filter hook prerouting priority 0;\n"
    + "".join(f"{TO_AIR} @th,{KIND_AT},8 {number} counter name {name}\n" for number, name in enumerate(_NAMES))
    + "}\n}\n"
)
_INSIDE = "link set lo up\naddress add 10.83.0.{}/16 dev eth0\nlink set eth0 up\n"
_EARS = "table inet radio { chain ears { type filter hook input priority 0; }; }\n"

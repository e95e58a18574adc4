"""A soak as it goes on: the schedule is carried out on the fleet, and what is seen is noted."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from itertools import count
from math import inf
from pathlib import Path

from benchmarks.channel.desk import Ordered
from benchmarks.report import Json
from benchmarks.soak.evidence import Known, Sent, Taken, taken
from benchmarks.soak.nodes import MICROPYTHON, OPERATORS, SLEEP, START, Computer, Fleet, NodeError, cpu_of
from benchmarks.soak.schedule import DOWN, RULES, Event, schedule

AT_ONCE = 8
"""Computers that start at the same time."""
LIFE = 60.0
"""Simulated seconds for which a one-shot command is good."""
ANSWERING = 60.0
"""Simulated seconds after its deadline until which an answer that a robot obeyed a command in time may come."""
LEASE = 300.0
GROUP, MEMBERS = "red", 8
LOSS = 0.1
GLANCE = 0.05
"""Real seconds between two looks at what is due."""
SAMPLES = 60
"""How often in a run it is noted what processes take."""
CATCH_UP = 300.0
"""Simulated seconds in which MicroPython, which has forgotten all, gets the standing commands again."""
SETTLED = 600.0
"""Simulated seconds after the end in which every rule must have reached every robot."""
ASK_EVERY, TOGETHER, ANSWERED = 30.0, 4, 4.0
"""Simulated seconds between two rounds of questions then, how many are asked at a time, and the seconds of this
machine's own in which they are answered."""
BETWEEN = 0.3
"""Seconds between two orders at first, which small computers need to verify them."""
STOP_WITHIN = 4.0
"""Seconds after a STOP in which it is counted; these are this machine's own."""
TRIES = 5
"""Starts of a node whose body was not found, as a supervisor of services makes them."""
TELL_EVERY = 10.0
"""Real seconds between two lines of progress."""


class Soak:
    """See the module. seconds: simulated; speed: how many times faster than this machine's clock. say: takes lines."""

    def __init__(self, fleet: Fleet, seed: int, seconds: float, speed: float, say: Callable[[str], None]) -> None:
        self.fleet, self.clocks, self.seconds, self.speed, self._say = fleet, fleet.clocks, seconds, speed, say
        names = [each.name for each in fleet.computers]
        clocked = [each.name for each in fleet.computers if each.kind != MICROPYTHON]
        spared = fleet.firsts().values()  # so that each kind has lives in which growth shows
        self.plan = schedule(seed, seconds, names, clocked, OPERATORS, spared)
        self.known = Known()
        self.seen: list[Taken] = []
        self.done: Counter[str] = Counter()
        """What has happened, by its name."""
        self.ended: list[str] = []
        """Nodes that have ended by themselves."""
        self.slow = 0.0
        """Real s by which a look at what was due came late, at most."""
        self.settled, self.real, self.busy = inf, 0.0, 0.0
        """Simulated s until all rules were everywhere; real s of the run, and those of the processor in them."""
        self.largest_log = 0
        """Bytes that are written ahead of a store, at most."""
        self._computers = {each.name: each for each in fleet.computers}
        self._operators: dict[str, Ordered] = {}
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._lives = dict.fromkeys(OPERATORS, 0)
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._tie = count()
        self._tries: Counter[str] = Counter()
        self._jumped: set[str] = set()
        """Computers whose clock is wrong now: a life that begins there keeps the wrong time."""
        self._began = self._told = 0.0
        self._rolled_back = 0.0
        """When the rules that a ROLLBACK has changed are to be sent anew, s of simulated Unix time; 0 for none."""
        self._texts: dict[str, str] = {}
        """The last text of each rule, by the variable that it sets."""

    # ---- from the beginning to the end

    def run(self) -> None:
        """All of it. Raises NodeError where the fleet does not begin."""
        fleet = self.fleet
        for first in range(0, len(fleet.computers), AT_ONCE):
            some = fleet.computers[first : first + AT_ONCE]
            for computer in some:
                fleet.begin(computer)
            fleet.wait_until_up(some)
        for operator in OPERATORS:
            self._begin_operator(operator)
        self._say(f"{len(fleet.names.read_text().split())} nodes on {len(fleet.computers)} computers are up")
        self._introduce()
        fleet.lab.lose(LOSS)
        self.clocks.rate = self.speed
        self._began, real, busy = self.clocks.now(), time.monotonic(), self._cpu()
        for event in self.plan:
            self._at(self._began + event.time, lambda event=event: self._carry_out(event))  # type: ignore[misc]
        for number in range(SAMPLES + 1):
            self._at(self._began + self.seconds * number / SAMPLES, self._sample)
        self._pass(self._began + self.seconds)
        self._end()
        self.real, self.busy = time.monotonic() - real, self._cpu() - busy

    def _introduce(self) -> None:
        """Variables and a group, which all robots have before anything goes wrong."""
        for operator in OPERATORS:
            self.known.wanted |= {f"{operator}_v{number}": 0.0 for number in range(RULES)}
            for name in (f"{operator}_n", *(f"{operator}_v{number}" for number in range(RULES))):
                self._order(operator, "send", text=f"(DEFVAR {name} 0)", standing=True)
                self._pass(self.clocks.now() + BETWEEN)
        alone = [each for each in self.fleet.computers if each.kind == SLEEP]
        self.known.members = frozenset(robot for each in alone[:MEMBERS] for robot in each.robots)
        if self.known.members:
            only = sorted(self.known.members)
            self._order(OPERATORS[0], "send", text=f"(JOIN {GROUP})", only=only)
        last, until = " ".join(f"{operator}_v{RULES - 1}" for operator in OPERATORS), time.monotonic() + START
        while True:  # commands of one sender come in their order
            self._ask([f"(+ {last})"])
            if self._is_right(f"(+ {last})", 0.0):
                return
            if time.monotonic() > until:
                raise NodeError(f"on a clear air not all robots know {last} after {START:g} s")

    def _end(self) -> None:
        """Everything is mended; robots are asked what they know until it is right, or the time is over."""
        self._due.clear()
        self.fleet.lab.heal()
        now = self.clocks.now()
        for computer in self.fleet.computers:
            self.clocks.jump(computer.name, 0.0)
            computer.come_back("cut", now)
            if "wrong" in computer.reasons:
                self.fleet.kill(computer)
                computer.come_back("wrong", now)
                self._restart(computer)
            elif "down" in computer.reasons and not computer.processes:
                self._restart(computer)
        for operator in OPERATORS:
            if operator not in self._operators:
                self._begin_operator(operator)
        since = self.clocks.now()
        while any("down" in each.reasons for each in self.fleet.computers) and self.clocks.now() < since + SETTLED:
            self._pass(self.clocks.now() + 5.0)
        self._order(OPERATORS[0], "release")
        if self._rolled_back:  # just before the end
            self._pass(self._rolled_back)
            for name in sorted(self._texts):
                self._again(name)
        since = self.clocks.now()
        wrong = texts = [*self.known.wanted, *(f"{operator}_n" for operator in OPERATORS)]
        while wrong and self.clocks.now() < since + SETTLED:
            self._pass(self.clocks.now() + ASK_EVERY)
            self.clocks.rate = 1.0
            for first in range(0, len(wrong), TOGETHER):
                self._ask(wrong[first : first + TOGETHER])
            self.clocks.rate = self.speed
            if not (wrong := [text for text in texts if not self._is_right(text, self.known.wanted.get(text))]):
                self.settled = self.clocks.now() - since
        stores = [store for each in self.fleet.computers for store in self.fleet.stores_of(each)]
        self.largest_log = max(map(_log_of, stores))
        self.known.read(stores)

    def _ask(self, texts: Sequence[str]) -> None:
        """Note what robots say to these, at this machine's own speed."""
        asked = {text: self._order(OPERATORS[0], "ask", text=text)["id"] for text in texts}
        self._pass(self.clocks.now() + ANSWERED)
        for text, command in asked.items():
            found = self._order(OPERATORS[0], "answers", command=command)["answers"]
            assert isinstance(found, dict)
            self.known.values.setdefault(text, {}).update({name: said[1] for name, said in found.items()})

    def _is_right(self, text: str, wanted: float | None) -> bool:
        """Whether every robot has said this value, any if that is None."""
        values = self.known.values[text]
        robots = [robot for each in self.fleet.computers for robot in each.robots]
        return all(robot in values and wanted in (None, values[robot]) for robot in robots)

    # ---- time

    def _at(self, when: float, do: Callable[[], None]) -> None:
        heappush(self._due, (when, next(self._tie), do))

    def _after(self, seconds: float, do: Callable[[], None]) -> None:
        self._at(self.clocks.now() + seconds, do)

    def _pass(self, until: float, *, events: bool = True) -> None:
        """Do what is due until then (s of simulated Unix time)."""
        while (now := self.clocks.now()) < until:
            while events and self._due and self._due[0][0] <= now:
                when, _, do = heappop(self._due)
                self.slow = max(self.slow, (now - when) / self.clocks.rate)
                do()
                now = self.clocks.now()
            for computer in self.fleet.computers:
                self._look(computer)
            self._tell()
            time.sleep(min(GLANCE, max(0.0, until - self.clocks.now()) / self.clocks.rate))

    def _tell(self) -> None:
        if self._began and time.monotonic() - self._told > TELL_EVERY:
            self._told = time.monotonic()
            passed = self.clocks.now() - self._began
            up = sum(len(each.robots) for each in self.fleet.computers if not each.reasons)
            did = ", ".join(f"{number} {what}" for what, number in sorted(self.done.items()))
            self._say(f"{passed:,.0f} of {self.seconds:,.0f} s; {up} in reach; {did}; load {os.getloadavg()[0]:.1f}")

    # ---- computers

    def _look(self, computer: Computer) -> None:
        """Note that a node is up, or has ended by itself; one that did not find its body begins once more."""
        if not computer.processes:
            return
        try:
            up = self.fleet.look(computer)
        except NodeError as error:
            if not computer.up and self._tries[computer.name] < TRIES:
                self._tries[computer.name] += 1
                self.done["start again"] += 1
            else:
                self.ended.append(str(error))
            self.fleet.kill(computer)
            computer.leave("down", self.clocks.now())
            self._restart(computer)
            return
        if up and "down" in computer.reasons:
            self._tries[computer.name] = 0
            if computer.stores:
                computer.come_back("down", self.clocks.now())
            else:
                life = computer.lives
                computer.reasons.add("forgot")
                computer.come_back("down", self.clocks.now())
                self._after(CATCH_UP, lambda: self._caught_up(computer, life))

    def _caught_up(self, computer: Computer, life: int) -> None:
        if computer.lives == life:
            computer.come_back("forgot", self.clocks.now())

    def _restart(self, computer: Computer) -> None:
        computer.leave("down", self.clocks.now())
        self.fleet.begin(computer)

    def _kill(self, computer: Computer, down: float) -> None:
        computer.leave("down", self.clocks.now())
        self.fleet.kill(computer)
        computer.processes = []
        self._after(down, lambda: self._restart(computer))

    # ---- operators

    def _begin_operator(self, operator: str) -> None:
        self._lives[operator] += 1
        with (self.fleet.folder / f"{operator}.said").open("a") as said:
            process = self.fleet.lab.start(
                operator,
                *(sys.executable, "-m", "benchmarks.soak.operator", operator, self.fleet.keys, self.fleet.names),
                environment=self.fleet.environment(operator),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said.fileno(),
            )
        self._processes[operator], self._operators[operator] = process, Ordered(process)

    def _order(self, operator: str, do: str, **arguments: object) -> dict[str, object]:
        return self._operators[operator].order(do, **arguments)

    def _send(self, operator: str, text: str, **how: object) -> Sent:
        told = self._order(operator, "send", text=text, **how)
        counts = text.startswith(f"(SETQ {operator}_n ")
        found = _sent(operator, text, told, counts=counts)
        self.known.sent.append(found)
        return found

    def _look_up(self, sent: Sent, life: int) -> None:
        """Note who has answered a command, if the program that sent it still runs."""
        if self._lives[sent.operator] == life and sent.operator in self._operators:
            said = self._order(sent.operator, "answers", command=sent.id)["answers"]
            assert isinstance(said, dict)
            self.known.answered[sent.id] = frozenset(name for name, each in said.items() if each[0] == "matched")

    # ---- what happens

    def _carry_out(self, event: Event) -> None:
        if event.who and event.who[0] in OPERATORS and event.what != "restart" and event.who[0] not in self._operators:
            return  # its program is down
        what = event.what.replace("-", "_")
        if getattr(self, f"_do_{what}")(event) is not False:
            self.done[event.what] += 1

    def _do_kill(self, event: Event) -> bool:
        computer = self._computers[event.who[0]]
        if computer.reasons - {"forgot"} or computer.name in self._jumped:
            return False
        self._kill(computer, event.lasts)
        return True

    def _do_partition(self, event: Event) -> bool:
        cut = [each for each in (self._computers[name] for name in event.who) if each.up and not each.reasons]
        for computer in cut:
            computer.leave("cut", self.clocks.now())
        if cut:
            self.fleet.lab.cut(*(each.name for each in cut))
            self._after(event.lasts, lambda: self._heal(cut))
        return bool(cut)

    def _heal(self, cut: list[Computer]) -> None:
        self.fleet.lab.heal(*(each.name for each in cut))
        for computer in cut:
            computer.come_back("cut", self.clocks.now())

    def _do_clock(self, event: Event) -> bool:
        computer = self._computers[event.who[0]]
        if computer.reasons or computer.name in self._jumped:
            return False
        self._jumped.add(computer.name)
        self.clocks.jump(computer.name, event.amount)
        self._after(event.lasts, lambda: self._jump_back(computer))
        return True

    def _jump_back(self, computer: Computer) -> None:
        self._jumped.remove(computer.name)
        self.clocks.jump(computer.name, 0.0)

    def _do_wrong(self, event: Event) -> bool:
        computer = self._computers[event.who[0]]
        if computer.reasons or computer.name in self._jumped:
            return False
        computer.leave("wrong", self.clocks.now())
        self.clocks.jump(computer.name, event.amount)
        self._kill(computer, DOWN[0])
        self._after(event.lasts, lambda: self._set_right(computer))
        return True

    def _set_right(self, computer: Computer) -> None:
        self.clocks.jump(computer.name, 0.0)
        if computer.processes:
            self.fleet.kill(computer)
        computer.leave("down", self.clocks.now())
        computer.come_back("wrong", self.clocks.now())
        self._restart(computer)

    def _do_restart(self, event: Event) -> None:
        operator = event.who[0]
        self.fleet.lab.stop(self._processes[operator], 9)
        del self._operators[operator]
        self._after(event.lasts, lambda: self._begin_operator(operator))

    def _do_one_shot(self, event: Event) -> None:
        operator = event.who[0]
        life = self._lives[operator]
        sent = self._send(operator, f"(SETQ {operator}_n (+ {operator}_n 1))", deadline=LIFE)
        self._after(LIFE + ANSWERING, lambda: self._look_up(sent, life))

    def _do_rule(self, event: Event) -> None:
        operator, number = event.who[0], int(event.amount)
        self._rule(operator, number % RULES, number)

    def _rule(self, operator: str, which: int, value: int) -> None:
        name = f"{operator}_v{which}"
        self._texts[name] = f"(RULE {operator}_r{which} (SETQ {name} {value}))"
        self.known.wanted[name] = float(value)
        self._send(operator, self._texts[name], standing=True)

    def _do_rollback(self, event: Event) -> None:
        """Rules that were proven come back; then both operators send theirs anew, so that all are the same again."""
        self._send(event.who[0], "(ROLLBACK)", deadline=LIFE)
        self._rolled_back = self.clocks.now() + LIFE + 10.0
        self._at(self._rolled_back, self._all_again)

    def _all_again(self) -> None:
        if len(self._operators) < len(OPERATORS):
            self._after(10.0, self._all_again)
            return
        self._rolled_back = 0.0
        for name in sorted(self._texts):
            self._again(name)

    def _again(self, name: str) -> None:
        self._send(name.partition("_")[0], self._texts[name], standing=True)

    def _do_lease(self, event: Event) -> bool:
        if not self.known.members:
            return False
        told = self._order(event.who[0], "lease", deed="take", group=GROUP, seconds=LEASE)
        taken_at = _sent(event.who[0], "LEASE", told, counts=False)
        self.known.leases.append(
            Sent(taken_at.operator, taken_at.id, "LEASE", taken_at.issued, taken_at.issued + LEASE, counts=False)
        )
        return True

    def _do_stop(self, event: Event) -> bool:
        """At this machine's own speed: the robots drive, one operator stops them, the other one releases them."""
        stops = event.who[0]
        drives = next(each for each in OPERATORS if each != stops)
        if drives not in self._operators:
            return False
        self.clocks.rate = 1.0
        driven = [robot for each in self.fleet.computers if each.stores for robot in each.robots]
        self._order(drives, "send", text="(SETQ drive_speed 0.2)", only=driven)
        self._pass(self.clocks.now() + 2.0, events=False)
        stop = _sent(stops, "STOP", self._order(stops, "stop"), counts=False)
        self.known.stopped.append(stop)
        self._pass(self.clocks.now() + STOP_WITHIN, events=False)
        self._look_up(stop, self._lives[stops])
        self._order(drives, "release")
        self._pass(self.clocks.now() + 2.0, events=False)
        self.clocks.rate = self.speed
        return True

    # ---- what they take

    def _cpu(self) -> float:
        """Seconds of the processor that everything here has used, with what has ended."""
        ours = os.times()
        living = sum(self.fleet.cpu().values()) + sum(cpu_of(each) for each in self._processes.values())
        return living + ours.user + ours.system + ours.children_user + ours.children_system

    def _sample(self) -> None:
        now = self.clocks.now() - self._began
        for computer in self.fleet.computers:
            if computer.processes and computer.up:
                stores = self.fleet.stores_of(computer)
                self._note(computer.name, computer.lives, now, computer.processes[-1].pid, stores)
        for operator, process in self._processes.items():
            journals = (self.fleet.folder / "hosts" / operator).rglob("journals/*")
            self._note(operator, self._lives[operator], now, process.pid, list(journals))
        if self.fleet.server is not None:
            self._note("nserver", 1, now, self.fleet.server.pid, [])

    def _note(self, who: str, life: int, now: float, pid: int, stored: list[Path]) -> None:
        found = taken(who, life, now, pid, stored)
        if found is not None:
            self.seen.append(found)


def _log_of(store: Path) -> int:
    """Bytes of what is written ahead of a store."""
    log = store.with_name(f"{store.name}-wal")
    return log.stat().st_size if log.exists() else 0


def _sent(operator: str, text: str, told: Json, *, counts: bool) -> Sent:
    issued, deadline = told["issued"], told["deadline"]
    assert isinstance(issued, float)
    assert isinstance(deadline, float | int)
    return Sent(operator, str(told["id"]), text, issued, float(deadline), counts)

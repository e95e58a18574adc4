"""The node: one robot's mind. Messages and readings come in, a tick lets it think, what it says lies in its outbox.

It knows no socket, no array and no page, and a test can drive it without any of them. Messages are evaluated once, in
the order in which they came; then the active rules run. STOP and RELEASE are no matter of the language: they take
effect when they are received.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterable, Sequence
from functools import partial
from math import inf

from sleepcast.channel.clock_sync import differs
from sleepcast.channel.message import Kind, Message
from sleepcast.channel.payload import LEASE, LOOK, MATCHED, hops_left, is_addressed
from sleepcast.core.errors import SleepcastError
from sleepcast.language.explain import Explanation, Recollection, explain, rehearse
from sleepcast.language.form import show
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.lint import Checked, check
from sleepcast.language.parts import Part
from sleepcast.language.program import Program, evaluate
from sleepcast.language.reader import read
from sleepcast.language.rehearsal import Answer
from sleepcast.language.symbols import Declared, UserVariable
from sleepcast.language.vocabulary import FROZEN, SLEEPING, Variable, Vocabulary, buffer_number
from sleepcast.mind.lease import DeadManSwitch, drives
from sleepcast.mind.merging import enqueue, place_of
from sleepcast.mind.views import Result, RuleView
from sleepcast.node.acts import ACTS
from sleepcast.node.buffers import ExpressionBuffer
from sleepcast.node.embodied import Embodied
from sleepcast.node.linking import VariableTable
from sleepcast.node.memory import RobotMemory, Voice
from sleepcast.node.scheduler import Scheduler
from sleepcast.node.telemetry import NOTHING, answer_look

MAX_RECOLLECTIONS = 64
"""Evaluations of messages that a robot can still explain."""
MAX_QUEUE = 64
"""Messages waiting for the next tick; more are dropped and counted, as a radio drops what it has no room for."""
MAX_BACKLOG = 4_096
"""... on a real channel, where what was missing comes with everything that waited for it: as many as a sender's numbers
are told apart. In one tick as many are dealt with as without one."""
MAX_SEEN = 1_024
"""Message ids remembered so that a repeated message changes nothing."""
MAX_FAULTS_IN_ROW = 10
"""Evaluations with a fault, one after the other, after which a rule is deactivated."""

Recollected = tuple[Program, list[float], frozenset[str], list[Answer], float, int, str]


class Node(Embodied):
    """One robot's mind.

    number: its `id` in expressions and in its chance. seed: of the run. body: what the functions of its vocabulary are
    called on (the linked object, if none is given); if it is a `Robot` it is stopped, released and held still as well.
    variables: linked variables, if any. lease: s for which a body that is driven goes on while nobody is heard.
    on_air: whether it hears a real channel, and not a simulated one: then
    more may wait, and what several operators send is merged.
    """

    def __init__(
        self,
        name: str,
        vocabulary: Vocabulary,
        *,
        number: int = 0,
        seed: int = 0,
        body: object | None = None,
        variables: VariableTable | None = None,
        lease: float = inf,
        on_air: bool = False,
    ) -> None:
        table = variables or VariableTable(vocabulary.name, like=vocabulary)
        super().__init__(name, table.body if body is None else body)
        self.number = number
        self._memory = RobotMemory(
            table,
            Voice(self._report, self._may_tell, self._tell, self._ping),
            ACTS,
            number=number,
            seed=seed,
            body=self.body,
        )
        self._deadman = DeadManSwitch(lease)
        self._scheduler = Scheduler(self._memory.rules, self._run_rule)
        self._queue: deque[Message] = deque()
        self._seen: OrderedDict[str, None] = OrderedDict()
        # The fields of a Recollection, made into one only when somebody asks: this happens for every message.
        self._recollections: deque[Recollected] = deque(maxlen=MAX_RECOLLECTIONS)
        self._on_air, self._room = on_air, MAX_BACKLOG if on_air else MAX_QUEUE

    # ---- what others look at

    @property
    def vocabulary(self) -> Vocabulary:
        return self._memory.vocabulary

    @property
    def memory(self) -> RobotMemory:
        """What it knows, for whoever keeps it."""
        return self._memory

    @property
    def values(self) -> list[float]:
        """The numbers by slot; NaN is unknown. Linked variables lie in the host's memory instead."""
        return self._memory.values

    @property
    def groups(self) -> frozenset[str]:
        """Keys of the groups that the robot is in."""
        return self._memory.groups

    @property
    def waiting(self) -> Iterable[Message]:
        """The messages that wait for the next tick, or the one after it, in their order."""
        return self._queue

    @property
    def awake(self) -> bool:
        """Whether the next tick has anything to do: a message, rules that run, or a body that is driven."""
        return bool(self._queue) or bool(self._memory.rules.running) or self._memory.driven

    @property
    def dropped(self) -> int:
        """Assignments and calls that an unknown kept from the body."""
        return self._memory.dropped

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key."""
        return self._memory.declared(key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return self._memory.heard()

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names."""
        buffer = self._memory.rules.kept.get(part.name)
        return None if buffer is None else buffer.program

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names, None if it has none of that name."""
        return self._memory.operators.get(part.name)

    def rules(self) -> list[RuleView]:
        """Every kept expression, in the order of the round."""
        return [
            RuleView(
                b.name,
                b.text,
                b.active,
                b.last_value,
                b.last_fault,
                b.steps,
                b.firings,
                b.lease,
                b.priority,
                b.protected,
            )
            for b in self._memory.rules.in_order()
        ]

    def variables(self) -> list[tuple[str, float]]:
        """Every variable by name, in the order of the vocabulary, user variables last."""
        memory = self._memory
        found = [
            (binding.name, memory.peek(binding.slot))
            for binding in self.vocabulary.bindings.values()
            if isinstance(binding, Variable)
        ]
        learned = [d for d in memory.learned.values() if isinstance(d, UserVariable)]
        return found + [(d.name, memory.values[d.slot]) for d in learned]

    def actuators(self) -> dict[str, float]:
        """The actuators in the list of values that were assigned since the last call, by name."""
        memory = self._memory
        if not memory.actuated:
            return {}
        first = self.vocabulary.first_actuator
        own = sorted(memory.actuated - memory.variables.linked_slots)
        taken = {self.vocabulary.actuators[slot - first].name: memory.values[slot] for slot in own}
        memory.actuated.clear()
        return taken

    # ---- what comes in

    def receive(self, message: Message) -> None:
        """Take a message from the channel: STOP and RELEASE at once, commands and questions into the queue."""
        if message.id in self._seen:
            return
        self._seen[message.id] = None
        if len(self._seen) > MAX_SEEN:
            self._seen.popitem(last=False)
        if message.ahead and message.kind is not Kind.STOP:
            if is_addressed(message.body, self.name):
                self._answer(message, "fault", fault=f"its clock is {differs(-message.ahead)}: it obeys STOP only")
            return
        self._deadman.hear(message)
        if message.kind is Kind.STOP:
            self._stop(message)
        elif not is_addressed(message.body, self.name):
            return
        elif message.kind is Kind.RELEASE:
            self._release(message)
        elif message.kind in (Kind.COMMAND, Kind.ASK):
            if len(self._queue) >= self._room:
                self.lost += 1
            elif self._on_air:
                enqueue(self._queue, message, self.zero)
            else:
                self._queue.append(message)

    def recall(self, ids: Iterable[str]) -> None:
        """Messages with these ids have been dealt with in a life before this one."""
        self._seen.update(dict.fromkeys(ids))

    def sense(self, readings: Sequence[float], now: float) -> None:
        """Take sensor values (SI, in the order of the vocabulary's sensors, NaN: not measured) at `now` (s)."""
        self._memory.variables.sense(self.values, readings, now)

    def think(self, tick: int, now: float) -> None:
        """One tick: the messages that are waiting, then one round of the active rules, unless asleep or frozen."""
        memory = self._memory
        memory.at(tick, now)
        self._now = now
        memory.variables.refresh(memory.values, now)
        if self._deadman.is_over(now) and memory.driven:
            self._let_go()
        if memory.rules.leases:
            for buffer in memory.rules.expire(now):
                self._report(f"lease of {buffer.name} ended", ())
        for _ in range(min(len(self._queue), MAX_QUEUE)):
            self._obey(self._queue.popleft(), now)
        if memory.rules.running and not (memory.values[SLEEPING] > 0 or memory.values[FROZEN] > 0):
            memory.moved = False
            self._scheduler.round()
            memory.driven &= not memory.moved
        self._hold()

    def evaluate(self, text: str) -> Result:
        """Check and evaluate one text in this memory, as if it were a message. Raises ReadError and CheckError."""
        return self.run(check(text, self))

    def run(self, checked: Checked) -> Result:
        """Evaluate a text that has been checked. Raises CheckError if it has errors."""
        printed = self._printed = []
        value = self._run(checked.required(), "")
        self._printed = None
        memory = self._memory
        return Result(
            value,
            memory.matched,
            tuple(memory.faults),
            checked.cost,
            memory.steps,
            tuple(printed),
            partial(Recollection, *self._recollections[-1]),
        )

    def why(self, command: str | None = None) -> Explanation:
        """How a command was evaluated (by its id; None: the last one), or what a rule (by its name) would do now.

        Raises SleepcastError if the robot remembers neither.
        """
        for recollected in reversed(self._recollections):
            recollection = Recollection(*recollected)
            if command is None or recollection.command == command:
                return explain(recollection)
        buffer = self._memory.rules.kept.get((command or "").casefold())
        if buffer is not None:
            return rehearse(buffer.program, self._memory.rehearsal(), command=buffer.name)
        what = "no command" if command is None else f"no command or rule {command}"
        raise SleepcastError(f"{self.name} remembers {what}: it keeps the last {MAX_RECOLLECTIONS} commands")

    def install(self, name: str, text: str, *, priority: int = 0, protected: bool = True) -> None:
        """Give the robot an active rule of its own, before or while it runs. protected: nobody can change it by radio.

        Raises ReadError and CheckError for the text, SleepcastError if the rule is refused for another reason.
        """
        result = self.evaluate(f"(RULE {name} {show(read(text))})")
        if result.faults:
            raise SleepcastError(f"the rule {name} cannot be installed: {result.faults[0].reason}")
        number = buffer_number(name.casefold())
        buffer = self._memory.rules.kept[name.casefold() if number is None else f"e{number}"]
        buffer.priority, buffer.protected = priority, protected
        self._memory.rules.changed()

    # ---- evaluating

    def _run(self, program: Program, command: str) -> float:
        memory = self._memory
        answers: list[Answer] = []
        self._recollections.append(
            (program, memory.values.copy(), memory.groups, answers, memory.time, memory.tick, command)
        )
        memory.answers, memory.faults = answers, []
        value = evaluate(program, memory)
        memory.answers = None
        return value

    def _run_rule(self, buffer: ExpressionBuffer) -> None:
        memory = self._memory
        memory.faults = []
        buffer.last_value = evaluate(buffer.program, memory)
        buffer.steps = memory.steps
        if memory.matched:
            buffer.firings += 1
        if not memory.faults:
            buffer.faults_in_row = 0
            return
        buffer.last_fault = str(memory.faults[0])
        buffer.faults_in_row += 1
        memory.rule_faulted()
        here = memory.rules.kept.get(buffer.key) is buffer  # it may have forgotten itself, and made another one
        if here and buffer.faults_in_row >= MAX_FAULTS_IN_ROW and not buffer.protected:
            memory.rules.activate(buffer, False)
            memory.rule_failed()
            self._report(f"rule {buffer.name} deactivated", ())

    def _obey(self, message: Message, now: float) -> None:
        if now > message.deadline:
            self._answer(message, "late")
            return
        memory = self._memory
        if message.kind is Kind.ASK and LOOK in message.body:
            stops = self.authority.stops(now)
            self._answer(
                message, "answer", told=answer_look(message.body, memory, self.stopped, self.doubt, stops, self.why)
            )
            return
        if message.kind is Kind.COMMAND and LEASE in message.body:
            group, refusal = self.authority.lease(message, now)
            granted = "matched" if group in self.groups else "not matched"
            self._answer(message, "fault" if refusal else granted, fault=refusal)
            return
        try:
            program = memory.library.program(message.text, lambda: [read(message.text)], memory)
        except SleepcastError as error:
            self._answer(message, "fault", fault=str(error).splitlines()[0])
            return
        objection = self.authority.objection(message, program, self.groups, now)
        if objection:
            self._answer(message, "fault", fault=objection)
            return
        if message.kind is Kind.ASK:
            found = rehearse(program, memory.rehearsal(), command=message.id)
            told = {MATCHED: found.matched} if MATCHED in message.body else NOTHING
            self._answer(message, "answer", found.value, "; ".join(found.faults), told)
            return
        memory.moved = False
        memory.merging.begin(place_of(message, self.zero) if self._on_air else None)
        memory.hops = hops_left(message.body, message.role, MAX_HOPS)
        value = self._run(program, message.id)
        memory.hops = MAX_HOPS
        memory.merging.begin(None)
        if memory.moved:
            memory.driven = drives(message)
        if memory.faults:
            self._answer(message, "fault", value, str(memory.faults[0]))
        else:
            self._answer(message, "matched" if memory.matched else "not matched", value)

    def interrupted(self, message: Message) -> None:
        """Answer a message that the life before this one began to evaluate: that is not done again."""
        self._answer(message, "fault", fault="interrupted: the robot was restarted while it did this")

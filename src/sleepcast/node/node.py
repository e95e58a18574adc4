"""The node: one robot's mind. It takes messages and readings, a tick evaluates them, and its messages wait in its
outbox.

It uses no sockets, arrays or pages, so a test can drive it without any of them. Messages are evaluated once, in
order of arrival; then the active rules run. STOP and RELEASE are not part of the language: they take effect when
they are received.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import inf, isnan, nan
from typing import TYPE_CHECKING

from sleepcast.channel.message import (
    HELD,
    HOPS,
    KEYS,
    LEASE,
    LOOK,
    MOTION,
    RULE,
    UNKNOWN,
    Kind,
    Message,
    answer_body,
    hops_left,
    is_addressed,
    relay_body,
)
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import RestState
from sleepcast.language.explain import Explanation, Recollection, explain, foretell, rehearse, with_bid
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.lint import Checked, check, unit_of_program
from sleepcast.language.parts import Part, auction_of, timed_of
from sleepcast.language.program import Program, decide, evaluate
from sleepcast.language.reader import read, show
from sleepcast.language.rehearsal import Answer
from sleepcast.language.symbols import Declared, UserVariable
from sleepcast.language.vocabulary import FROZEN, SLEEPING, Variable, Vocabulary, rule_key
from sleepcast.mind.authority import (
    AT_REST,
    ENDED,
    Authority,
    Driving,
    Tells,
    arrived,
    driver_of,
    outcome_of_keys,
    outcome_of_untimely,
    outlasts,
)
from sleepcast.mind.evaluation_budget import EvaluationBudget
from sleepcast.mind.inspection import NOTHING, BodyState, Details, answer_inspection, foretold
from sleepcast.mind.limits import (
    ASKS_TOO_MUCH,
    FAILED,
    MAX_BACKLOG,
    MAX_FAULTS_IN_ROW,
    MAX_OUTBOX,
    MAX_QUESTIONS,
    MAX_QUEUE,
    MAX_SEEN,
    REPORTS_A_SECOND,
    TELL_SECONDS,
)
from sleepcast.mind.merging import enqueue, place_of
from sleepcast.mind.rules import in_order
from sleepcast.mind.telemetry import Motion, motion_of
from sleepcast.mind.views import EvaluatedCommand, Result, RuleView
from sleepcast.node.linking import VariableTable
from sleepcast.node.memory import OutputPort, RobotMemory
from sleepcast.node.scheduler import RuleRecord, Scheduler
from sleepcast.node.telling import TellLimit
from sleepcast.node.timing import TimedCommands
from sleepcast.robot import NOBODY_DRIVES, Failsafe, RestSensing, Robot

if TYPE_CHECKING:
    from sleepcast.mind.calling import Calls
    from sleepcast.node.auctions import NodeAuctions

MAX_RECOLLECTIONS = 64
"""Evaluations of messages that a robot can still explain."""
MAX_EVALUATED = 256
"""Messages whose outcome waits to be stored: those of one tick, and STOPs between two ticks."""

Recollected = tuple[Program, list[float], frozenset[str], list[Answer], float, int, str, bool]


class Node:
    """One robot's mind.

    stopped: whether a STOP holds.
    doubt: why it is stopped although no STOP may have come, "" otherwise.
    authority: whose orders count.
    catching_up: see `catch_up`.
    lost: messages lost because a queue or the outbox was full.
    evaluated: the latest messages that it answered, their outcomes, and the robot's time; its owner stores them and
        empties the list.
    zero: start of its time, s of Unix time, where that matters.
    clock: gives that time, None if the tick's time will do.
    keys_last: whether the keys that its channel trusts are stored, as far as they must be.
    budget: of the evaluations in its process, None if they need not be measured.

    number: its `id` in expressions and random streams.
    seed: of the run.
    body: target of its vocabulary's functions (default: the linked object); if it is a `Robot` it is also stopped,
        released and held still.
    variables: linked variables, if any.
    lease: seconds for which a driven body continues while no operator is heard.
    tells: what others may have it do by TELL.
    on_air: whether it uses a real channel instead of a simulated one: then more messages may wait, and the orders of
        several operators are merged.
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
        tells: Tells = Tells.ALL,
        on_air: bool = False,
    ) -> None:
        table = variables or VariableTable(vocabulary.name, like=vocabulary)
        self.name, self.number, self.epoch = name, number, 0
        self.body = table.body if body is None else body
        self.stopped, self.doubt, self.authority = False, "", Authority(tells)
        self.catching_up = False
        self.outbox: list[Message] = []
        self.pings: list[float] = []
        self.lost = 0
        self.evaluated: deque[tuple[Message, str, float]] = deque(maxlen=MAX_EVALUATED)
        self.zero = 0.0
        self.clock: Clock | None = None
        self.keys_last: Callable[[], bool] = lambda: True
        self.budget: EvaluationBudget | None = None
        self._memory = RobotMemory(
            table,
            OutputPort(self._report, self._may_tell, self._tell, self._ping, self._calls, self._cancel),
            number=number,
            seed=seed,
            body=self.body,
        )
        self._driving, self._lease = Driving(), lease
        self._speaks_for = self._sender = ""
        """The operator for whom the message is evaluated that is evaluated now, and who has sent it; "" for none."""
        self.auctions: NodeAuctions | None = None
        """Of commands that choose among robots, once there was one."""
        self.timing = TimedCommands(self, on_air=on_air)
        self.began = -inf
        """When this life began, s, where there may have been one before."""
        self._scheduler = Scheduler(self._memory.records, self._run_rule)
        self._queue: deque[Message] = deque()
        self._seen: OrderedDict[str, None] = OrderedDict()
        # The fields of a Recollection, turned into one only on request, because this happens for every message.
        self._recollections: deque[Recollected] = deque(maxlen=MAX_RECOLLECTIONS)
        self._on_air, self._room = on_air, MAX_BACKLOG if on_air else MAX_QUEUE
        self._now, self._was_still = 0.0, False
        self._sequence = 0
        self._printed: list[tuple[str, tuple[float, ...]]] | None = None
        """What the current text has reported, while a caller waits for its result."""
        self._reported_in, self._reported = 0, 0
        self._telling = TellLimit()

    # ---- state

    @property
    def vocabulary(self) -> Vocabulary:
        return self._memory.vocabulary

    @property
    def memory(self) -> RobotMemory:
        """Its memory, for storage."""
        return self._memory

    @property
    def values(self) -> list[float]:
        """The variables by slot; NaN is unknown. Linked variables are stored in the host's memory instead."""
        return self._memory.values

    @property
    def groups(self) -> frozenset[str]:
        """Keys of the groups that the robot is in."""
        return self._memory.groups

    @property
    def waiting(self) -> Iterable[Message]:
        """The messages that wait for the next tick or a later one, in order."""
        return self._queue

    @property
    def awake(self) -> bool:
        """Whether the next tick has anything to do: a message, a bid, an instant, active rules, or a driven body."""
        busy = self.timing.is_busy or (self.auctions is not None and self.auctions.is_busy)
        return bool(self._queue) or bool(self._memory.records.running) or self.driven or busy

    @property
    def driven(self) -> bool:
        """Whether the body was last moved by a person's one-time command; see `mind.authority`."""
        return bool(self._driving.driver)

    @property
    def dropped(self) -> int:
        """Number of assignments and calls that were not passed to the body because a value was unknown."""
        return self._memory.dropped

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key."""
        return self._memory.base.declared(key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return self._memory.base.heard()

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names."""
        rule = self._memory.base.rules.get(part.name)
        return None if rule is None else rule.program

    def operator(self, part: Part) -> Program | None:
        """The operator that a `call` part names, None if it does not exist."""
        return self._memory.base.operators.get(part.name)

    def rules(self) -> list[RuleView]:
        """Every stored expression, in order of evaluation."""
        views = []
        for rule in in_order(self._memory.base.rules):
            r = self._memory.records[rule.key]
            done = r.last_value, r.last_fault, r.steps, r.firings, r.lease
            rank, unit = (rule.shown_priority, rule.protected), unit_of_program(rule.program)
            views.append(RuleView(rule.name, rule.text, rule.active, *done, *rank, unit))
        return views

    def variables(self) -> list[tuple[str, float]]:
        """Every variable by name, in the order of the vocabulary, user variables last."""
        memory = self._memory
        declared = [
            (binding.name, memory.peek(binding.slot))
            for binding in self.vocabulary.bindings.values()
            if isinstance(binding, Variable)
        ]
        learned = [d for d in memory.base.symbols.values() if isinstance(d, UserVariable)]
        return declared + [(d.name, memory.values[d.slot]) for d in learned]

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

    # ---- input

    def receive(self, message: Message) -> None:
        """Receive a message from the channel: STOP and RELEASE take effect at once, commands and questions are
        queued."""
        if message.kind is Kind.REQUEST:  # which is no sign that somebody drives
            if self.auctions is not None:
                self.auctions.hear(message)
            return
        if message.id in self._seen:
            return
        self._seen[message.id] = None
        if len(self._seen) > MAX_SEEN:
            self._seen.popitem(last=False)
        if message.ahead and message.kind is not Kind.STOP:
            if is_addressed(message.body, self.name):
                outcome, fault = outcome_of_untimely(message)
                self.answer(message, outcome, fault=fault)
            return
        self._driving = self._driving.hear(message)
        if message.kind is Kind.STOP:
            self._stop(message)
        elif not is_addressed(message.body, self.name):
            return
        elif message.kind is Kind.RELEASE:
            self._release(message)
        elif message.kind in (Kind.COMMAND, Kind.ASK):
            if len(self._queue) >= self._room or self._asks_too_much(message):
                self.lost += 1
            elif self._on_air:
                enqueue(self._queue, message, self.zero)
            else:
                self._queue.append(message)

    def take_outbox(self) -> list[Message]:
        """What it has said since the last call."""
        outbox, self.outbox = self.outbox, []
        return outbox

    def _asks_too_much(self, message: Message) -> bool:
        """Whether so many questions of this sender wait already that another one is refused; it is told so."""
        if message.kind is not Kind.ASK or not self._on_air or len(self._queue) < MAX_QUESTIONS:
            return False
        waiting = sum(each.kind is Kind.ASK and each.sender == message.sender for each in self._queue)
        if waiting < MAX_QUESTIONS:
            return False
        self.say(Kind.ANSWER, body=answer_body(message.id, "fault", nan, ASKS_TOO_MUCH))
        return True

    def recall(self, ids: Iterable[str]) -> None:
        """Messages with these ids were already handled before a restart."""
        self._seen.update(dict.fromkeys(ids))

    def sense(self, readings: Sequence[float], now: float) -> None:
        """Take sensor values (SI, in the order of the vocabulary's sensors, NaN: not measured) at `now` (s)."""
        self._memory.variables.sense(self.values, readings, now)

    def think(self, tick: int, now: float) -> None:
        """Run one tick: the waiting messages, then one round of the active rules, unless asleep or frozen."""
        memory = self._memory
        memory.at(tick, now)
        self._now = now
        memory.variables.refresh(memory.values, now)
        self._driving = self._driving.ticked(now)
        if self._driving.is_over(now, self._lease):
            self._let_go()
        for rule in memory.records.expire(now):
            self._report(f"lease of {rule.name} ended", ())
        if self.began == -inf and self.clock is not None:
            self.began = now
        if self.auctions is not None:
            self.auctions.end_left_over()
        self._obey_waiting(now)
        if self.auctions is not None and self.auctions.is_busy:
            self.auctions.tick(now)
        if self.timing.is_busy:
            self.timing.tick_at(now)
        if memory.records.running and not (memory.values[SLEEPING] > 0 or memory.values[FROZEN] > 0):
            memory.moved = False
            self._scheduler.round()
            if memory.moved:
                self._driving = self._driving.let_go()
        self._hold()

    def _obey_waiting(self, now: float) -> None:
        """Deal with the messages that wait, in their order; those of a sender who has had its share wait on."""
        budget = self.budget
        if budget is None:
            for _ in range(min(len(self._queue), MAX_QUEUE)):
                self._obey(self._queue.popleft(), now)
            return
        held, left = deque[Message](), {Kind.COMMAND: MAX_QUEUE, Kind.ASK: MAX_QUEUE}
        try:
            while self._queue:
                message = self._queue.popleft()
                if left[message.kind] > 0 and budget.allows(message):
                    left[message.kind] -= 1
                    budget.evaluate(message, partial(self._obey, now=now))
                else:
                    held.append(message)
        finally:
            self._queue = held + self._queue

    def evaluate(self, text: str) -> Result:
        """Check and evaluate one text in this memory, as if it were a message. Raises ReadError and CheckError."""
        return self.run(check(text, self))

    def run(self, checked: Checked) -> Result:
        """Evaluate a checked text. Raises CheckError if it has errors."""
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

        Raises SleepcastError if the robot has no record of it.
        """
        for recollected in reversed(self._recollections):
            recollection = Recollection(*recollected)
            if command is None or recollection.command == command:
                bid = None if self.auctions is None else self.auctions.bidding.standing(recollection.command)
                return with_bid(explain(recollection), bid)
        rule = self._memory.base.rules.get((command or "").casefold())
        if rule is not None:
            memory, priority = self._memory.rehearsal(), rule.shown_priority
            return rehearse(rule.program, memory, command=rule.name, stopped=self.stopped, priority=priority)
        what = "no command" if command is None else f"no command or rule {command}"
        raise SleepcastError(f"{self.name} remembers {what}: it keeps the last {MAX_RECOLLECTIONS} commands")

    def install(self, name: str, text: str, *, priority: int = 0, protected: bool = True) -> None:
        """Give the robot an active rule of its own, before or while it runs. protected: it cannot be changed by radio.

        Raises ReadError and CheckError for the text, SleepcastError if the rule is refused for another reason.
        """
        result = self.evaluate(f"(RULE {name} {show(read(text))})")
        if result.faults:
            raise SleepcastError(f"the rule {name} cannot be installed: {result.faults[0].reason}")
        self._memory.base.rank(rule_key(name), priority, protected)
        self._memory.records.changed()

    # ---- the body

    def halt(self, doubt: str = "") -> None:
        """Stop, and stay stopped until RELEASE. doubt: see the class. Raises LinkError if something did not come to
        rest."""
        self.stopped, self.doubt = True, doubt
        if isinstance(self.body, Robot):
            self.body.stop()
        else:
            self._memory.held = True
        self._memory.variables.stop()

    def rest_state(self) -> RestState | None:
        """Whether its body has come to rest; None if that is not known of such a body."""
        return self.body.rest_state() if isinstance(self.body, RestSensing) else None

    def _motion(self) -> Motion | None:
        """How its body moves while it is stopped."""
        state = self.rest_state() if self.stopped else None
        return None if state is None else motion_of(state)

    def _stop(self, message: Message) -> None:
        if not self.authority.may_stop(message, self._now):
            self.answer(message, "fault", fault=ENDED)
            return
        if self.auctions is not None:
            self.auctions.stop()
        self.timing.stop(arrived(message, self._now))
        fault = ""
        try:
            self.halt()
        except SleepcastError as error:
            fault = str(error)
        # Every robot that receives STOP stops; robots that it is not addressed to need not report it again.
        if is_addressed(message.body, self.name):
            motion = self._motion()
            self.answer(message, "stopped", fault=fault, details={} if motion is None else {MOTION: [*motion]})

    def _release(self, message: Message) -> None:
        if refusal := outlasts(self.doubt, message):
            self.answer(message, "fault", fault=refusal)
            return
        if not self.authority.may_release(message):
            self.answer(message, "fault", fault=self.authority.latch.refusal())
            return
        self.stopped = self._memory.held = False
        self.doubt = ""
        self._memory.variables.release()
        if isinstance(self.body, Robot):
            self.body.release()
        self.answer(message, "released")

    def _let_go(self) -> None:
        """The operator who drove the body is gone: bring it to rest; nothing resumes on its own."""
        memory = self._memory
        self._driving = self._driving.let_go()
        memory.actuated.clear()
        if self.stopped:
            return
        if isinstance(self.body, Failsafe):
            self.body.let_go()
        elif isinstance(self.body, Robot):
            self.body.stop()
            self.body.release()
        try:
            memory.variables.stop()
            memory.variables.release()
        except SleepcastError as error:
            self._report(f"{NOBODY_DRIVES}, and it does not rest: {error}", ())
        else:
            self._report(AT_REST, ())

    def catch_up(self, lasts: bool) -> None:
        """The robot misses standing commands that others have, or no longer does. While it does, its body is held
        still, and only the rules run that cannot be changed by radio: others may have been replaced."""
        if lasts != self.catching_up:
            self.catching_up = lasts
            self._hold()

    def _hold(self) -> None:
        """Hold the body still while the robot sleeps, is frozen or catches up."""
        values = self._memory.values
        still = self.catching_up or values[SLEEPING] > 0 or values[FROZEN] > 0
        if still != self._was_still:
            self._was_still = still
            if isinstance(self.body, Robot):
                self.body.hold(still)

    # ---- evaluating

    def _run(self, program: Program, command: str, *, answered: bool = False) -> float:
        """answered: whether a person is told what came of it, so also why its test did not hold."""
        memory = self._memory
        answers: list[Answer] = []
        self._recollections.append(
            (program, memory.values.copy(), memory.groups, answers, memory.time, memory.tick, command, self.stopped)
        )
        memory.answers, memory.faults = answers, []
        memory.undecided = False
        value = decide(program, memory) if answered else evaluate(program, memory)
        memory.answers = None
        return value

    def _run_rule(self, record: RuleRecord) -> None:
        memory, rule = self._memory, record.rule
        if self.catching_up and not rule.protected:
            return
        memory.faults = []
        record.last_value = evaluate(rule.program, memory)
        record.steps = memory.steps
        if memory.matched:
            record.firings += 1
        if not memory.faults:
            record.faults_in_row = 0
            return
        record.last_fault = str(memory.faults[0])
        record.faults_in_row += 1
        memory.changing()  # its rule set is unproven again
        if record.faults_in_row >= MAX_FAULTS_IN_ROW and not record.gone and not rule.protected:
            memory.records.deactivate(rule.key)
            memory.unproven_since = FAILED  # those that are left do not become proven by doing nothing
            self._report(f"rule {rule.name} deactivated", (), {RULE: rule.name})

    def _obey(self, message: Message, now: float) -> None:
        if now > message.deadline:
            self.answer(message, "late")
            return
        memory = self._memory
        if message.kind is Kind.ASK and LOOK in message.body:
            stops = self.authority.stops(now)
            state = BodyState(self.stopped, self.driven, self.doubt, self.catching_up, stops, self._motion())
            self.answer(message, "answer", details=answer_inspection(message.body, memory.itself, state, self.why))
            return
        if message.kind is Kind.COMMAND and LEASE in message.body:
            group, refusal = self.authority.lease(message, now)
            granted = "matched" if group in self.groups else "not matched"
            self.answer(message, "fault" if refusal else granted, fault=refusal)
            return
        if message.kind is Kind.COMMAND and KEYS in message.body:
            outcome, fault = outcome_of_keys(message, self.keys_last)
            self.answer(message, outcome, fault=fault)
            return
        try:
            program = self.program(message.text, asked=message.kind is Kind.ASK)
        except SleepcastError as error:
            self.answer(message, "fault", fault=str(error).splitlines()[0])
            return
        objection = self.authority.objection(message, program, self.groups, now)
        if objection:
            self.answer(message, "fault", fault=objection)
            return
        timed = timed_of(program.root)
        if message.kind is Kind.ASK:
            program, rehearsal = program if timed is None else self.program(timed.command), memory.rehearsal()
            answer = foretell(program, rehearsal)
            details = foretold(message, answer, undecided=rehearsal.undecided)
            self.answer(message, "answer", answer.value, "; ".join(answer.faults), details)
            return
        if (auction := auction_of(program.root)) is not None:
            self.auctioning().poll(message, auction, now)
            return
        if timed is not None:
            self.timing.hear(message, timed, now)
            return
        outcome, value, fault = self.judge(program, message, now)
        self.answer(message, outcome, value, fault)

    def judge(self, program: Program, message: Message, now: float) -> EvaluatedCommand:
        """Evaluate a command, or what stands for it."""
        memory = self._memory
        answered = HOPS not in message.body  # nobody counts what becomes of what robots tell each other
        value = self._evaluate(program, message, answered=answered)
        if memory.moved:
            self._driving = self._driving.move(message, now)
        if memory.faults:
            return EvaluatedCommand("fault", value, str(memory.faults[0]))
        if memory.matched:
            return EvaluatedCommand(HELD if answered and memory.moved and self.stopped else "matched", value, "")
        return EvaluatedCommand(UNKNOWN if answered and memory.undecided else "not matched", value, "")

    def _evaluate(self, program: Program, message: Message, *, answered: bool) -> float:
        """Evaluate a command for whom it comes from."""
        memory = self._memory
        memory.moved, memory.barred = False, self.authority.bars(message)
        memory.base.merging.begin(place_of(message, self.zero) if self._on_air else None)
        memory.hops, self._speaks_for = hops_left(message.body, message.role, MAX_HOPS), driver_of(message)
        self._sender = message.sender
        value = self._run(program, message.id, answered=answered)
        memory.hops, memory.barred, self._speaks_for, self._sender = MAX_HOPS, "", "", ""
        memory.base.merging.begin(None)
        return value

    # ---- for its auctions, see `auctions`

    def auctioning(self) -> NodeAuctions:
        """Its auctions, from now on."""
        from sleepcast.node.auctions import NodeAuctions  # most robots are never asked

        self.auctions = self.auctions or NodeAuctions(self)
        return self.auctions

    def _calls(self) -> Calls | None:
        if self.stopped:
            return None
        calls = self.auctioning().calls
        calls.since = self.began
        return calls

    def program(self, text: str, *, asked: bool = False) -> Program:
        """asked: whether it is a question. Raises SleepcastError for a text that this robot cannot run."""
        memory = self._memory
        return memory.library.program(text, lambda: [read(text)], memory.base, asked=asked)

    def interrupted(self, message: Message) -> None:
        """Answer a message whose evaluation began before a restart: it is not repeated."""
        self.answer(message, "fault", fault="interrupted: the robot was restarted while it did this")

    # ---- output

    def say(self, kind: Kind, *, text: str = "", deadline: float = inf, body: dict[str, object] | None = None) -> None:
        """Put a message into the outbox."""
        if len(self.outbox) >= MAX_OUTBOX:
            self.lost += 1
            return
        self._sequence += 1
        self.outbox.append(
            Message(self.name, self.epoch, self._sequence, kind, self._now, deadline, text, False, body or {})
        )

    def answer(
        self, message: Message, outcome: str, value: float = nan, fault: str = "", details: Details = NOTHING
    ) -> None:
        self.say(Kind.ANSWER, body={**answer_body(message.id, outcome, value, fault), **details})
        self.evaluated.append((message, outcome, self._now if self.clock is None else self.clock.now() - self.zero))

    def _report(self, label: str, values: tuple[float, ...], details: Details = NOTHING) -> None:
        if self._printed is not None:
            self._printed.append((label, values))
        second = int(self._now)
        if second != self._reported_in:
            self._reported_in, self._reported = second, 0
        self._reported += 1
        if self._reported > REPORTS_A_SECOND:
            self.lost += 1
            return
        known = [None if isnan(v) else v for v in values]
        self.say(Kind.REPORT, body={"label": label, "values": known, **details})

    def remark(self, text: str, now: float = -inf) -> None:
        """Report something that no expression has asked for. now: s, where it has not thought in this tick."""
        self._now = max(self._now, now)
        self._report(text, ())

    def _may_tell(self, hops: int) -> bool:
        """Whether something may be told now, over this many hops; counted as told, or else as lost."""
        may = self._telling.allows(hops, self._now, self.remark)
        self.lost += not may
        return may

    def _tell(self, text: str, hops: int, auction: int | None) -> None:
        driver = (self._speaks_for or self._driving.driver) if self._on_air else ""
        body = relay_body(hops, driver, auction)
        self.say(Kind.COMMAND, text=text, deadline=self._now + TELL_SECONDS, body=body)

    def _cancel(self) -> float:
        bids = 0 if self.auctions is None else self.auctions.bidding.cancel(self._sender)
        return self.timing.cancel(self._sender) + bids

    def _ping(self, caste: float) -> None:
        if len(self.pings) < MAX_OUTBOX:
            self.pings.append(caste)
        else:
            self.lost += 1

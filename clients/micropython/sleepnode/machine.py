"""The machine: runs a program on a robot's memory.

Values lie on one stack and entered programs in a list, so nothing here calls itself, however deeply texts are nested:
the stack of a small computer's own interpreter is short. Unknown is None: like 0, it is not true.

A program is a tuple: its bytes, the keys of the buffers, rules and operators that it may enter (a tuple), and the
things that its instructions name: keys, functions, texts, programs.

Its bytes begin with eight that describe it: a rule's evaluations in a row with a fault (255: it is built in, and no
message can change it); flags (1: it runs, 2: a message with a top-level test, 4: a rule or buffer, 8: it ran when its
set of rules had proven itself); the steps charged on entering it (two bytes, the lower one first, like every number of
two bytes); how many lists lie inside one another; the places of its frame (two); how many of them are parameters.

Then come instructions: six bits of what is to be done, and above them how many bytes of a number follow, 0 (for zero)
to 2. The number is a slot, a place to jump to, how many arguments, or a constant in hundredths. Instructions from
`in` on name a thing, by two bytes. Behind `pure` comes the number of the function, behind `number` a float (eight
bytes), behind `repeat` and `next` a place of the frame (two), behind `repeat` a count as well (two).
"""

import struct

from micropython import const

from sleepnode.functions import CALLS, Undefined
from sleepnode.reader import format_number, general

_MAX_STEPS = const(10000)
_MAX_DEPTH = const(32)
_MAX_LEVELS = const(100)

# Where the bytes of a program say what.
_FLAGS = const(1)
_TESTED = const(2)
_COST = const(2)
_HEIGHT = const(4)
_PLACES = const(5)
_FIRST = const(8)

# The numbers of `forms.number_of`, as constants that cost no look-up.
_VARIABLE = const(0)
_CONSTANT = const(1)
_ELSE = const(2)
_LESS = const(3)
_MORE = const(4)
_PLUS = const(5)
_MINUS = const(6)
_TIMES = const(7)
_AND = const(8)
_PURE = const(9)
_WRITE = const(10)
_JUMP = const(11)
_POP = const(12)
_NUMBER = const(13)
_LOCAL = const(14)
_RETURN = const(15)
_MATCH = const(16)
_MATCH_IF = const(17)
_ELSE_TEST = const(18)
_AND_TEST = const(19)
_ANY = const(20)
_OR = const(21)
_OR_TEST = const(22)
_KNOWN = const(23)
_TAKE = const(24)
_KEEP = const(25)
_REPEAT = const(26)
_NEXT = const(27)
_PROB = const(28)
_DICE = const(29)
_UNKNOWN_SIDE = const(30)
_SIDE = const(31)
_NONE = const(32)
_RANDOM = const(33)
_GAUSS = const(34)
_FLAG = const(35)
_UNKNOWN = const(36)
_ACTS = const(37)
_NAMED = const(39)
_ASSIGN = const(48)
_ENTER = const(49)
_CALL = const(50)
_OPERATOR = const(51)
_HOST = const(52)
_DEFINED = const(53)
_STORE = const(54)
_OPERATE = const(55)
_REPORT = const(56)


def _finite(mind, value):
    return value if value - value == 0 else mind.fault("overflow")


def _pure(mind, call, arguments):
    if None in arguments:
        return None
    try:
        return _finite(mind, float(call(*arguments)))
    except Undefined as error:
        return mind.fault(str(error))
    except (ValueError, OverflowError, ZeroDivisionError):
        return mind.fault("overflow")


def _two(code, at):
    return code[at] | code[at + 1] << 8


def run(mind, program):
    """The value of a program, with all its effects. Leaves in the mind: matched, undecided, steps and faults."""
    code, pc = program[0], _FIRST
    mind.matched, mind.undecided = not code[_FLAGS] & _TESTED, False
    mind.steps, levels, local = _two(code, _COST), code[_HEIGHT], [None] * _two(code, _PLACES)
    stack, frames, values, thing = [], [], mind.values, None
    while True:
        op = code[pc]
        argument = 0
        if op & 64:
            pc += 1
            argument = code[pc]
        elif op & 128:
            argument = code[pc + 1] | code[pc + 2] << 8
            pc += 2
        pc += 1
        op &= 63
        if op >= _NAMED:
            at = code[pc] | code[pc + 1] << 8
            thing = program[at]
            pc += 2
        if op == _VARIABLE:
            stack.append(values[argument])
        elif op == _CONSTANT:
            stack.append(argument / 100)
        elif op == _ELSE or op == _ELSE_TEST:
            value = stack.pop()
            if not value:
                pc = argument
            if op == _ELSE_TEST:
                mind.note_test(value)
        elif op == _LESS or op == _MORE or op == _PLUS or op == _MINUS or op == _TIMES:
            y = stack.pop()
            x = stack[-1]
            if x is None or y is None:
                stack[-1] = None
            elif op == _LESS:
                stack[-1] = 1.0 if x < y else 0.0
            elif op == _MORE:
                stack[-1] = 1.0 if x > y else 0.0
            else:
                x = x + y if op == _PLUS else x - y if op == _MINUS else x * y
                stack[-1] = x if x - x == 0 else mind.fault("overflow")
        elif op == _AND or op == _AND_TEST:
            if stack[-1]:
                stack.pop()
            else:
                pc = argument
                if op == _AND_TEST:
                    mind.note_test(stack[-1])
        elif op == _PURE:
            stack.append(_pure(mind, CALLS[code[pc]], _taken(stack, argument)))
            pc += 1
        elif op == _WRITE:
            stack[-1] = mind.write(argument, stack[-1])
        elif op == _JUMP:
            pc = argument
        elif op == _POP:
            stack.pop()
        elif op == _NUMBER:
            stack.append(struct.unpack_from("<d", code, pc)[0])
            pc += 8
        elif op == _LOCAL:
            stack.append(local[argument])
        elif op == _ASSIGN:
            stack[-1] = mind.assign(thing, stack[-1])
        elif op == _RETURN:
            if not frames:
                return stack[-1]
            levels -= frames.pop()
            local, pc, program = frames.pop(), frames.pop(), frames.pop()
            code = program[0]
        elif op == _ENTER or op == _CALL:
            if op == _CALL:
                arguments = _taken(stack, argument)
                entered = mind.operator(thing, argument)
            else:
                arguments = []
                entered = mind.expression(thing)
            if not isinstance(entered, tuple):
                stack.append(entered)
                continue
            tall = entered[0][_HEIGHT]
            if len(frames) >= 4 * _MAX_DEPTH or levels + tall > _MAX_LEVELS:
                stack.append(mind.fault("calls nested too deeply: at most %d" % _MAX_DEPTH))
                continue
            mind.steps += _two(entered[0], _COST)
            if mind.steps > _MAX_STEPS:
                return mind.fault("out of steps: at most %d in one evaluation" % _MAX_STEPS)
            frames.append(program)
            frames.append(pc)
            frames.append(local)
            frames.append(tall)
            levels += tall
            program, code, pc = entered, entered[0], _FIRST
            local = arguments + [None] * (_two(code, _PLACES) - len(arguments))
        elif op == _OPERATOR:
            if mind.operator(thing, argument, program[at + 1]) is None:
                stack.append(None)
            else:
                pc += 3
        elif op == _MATCH:
            mind.matched = True
        elif op == _MATCH_IF:
            mind.note_test(stack[-1])
        elif op == _ANY:
            value = stack.pop()
            if value:
                stack[-1] = value
                pc = argument
            elif value is None:
                stack[-1] = None
        elif op == _OR or op == _OR_TEST:
            if op == _OR_TEST:
                mind.note_test(stack[-1])
            if stack[-1]:
                pc = argument
            else:
                stack.pop()
        elif op == _KNOWN:
            stack[-1] = 0.0 if stack[-1] is None else 1.0
        elif op == _TAKE:
            local[argument] = stack.pop()
        elif op == _KEEP:
            local[argument] = stack[-1]
        elif op == _REPEAT:
            if local[_two(code, pc)] >= _two(code, pc + 2):
                pc = argument
            else:
                pc += 4
        elif op == _NEXT:
            local[_two(code, pc)] += 1.0
            pc = argument
        elif op == _HOST:
            stack.append(mind.host(thing, program[at + 1], _taken(stack, argument)))
        elif op == _DEFINED:
            if thing in mind.learned:
                stack.append(mind.value_of(thing))
                pc = argument
        elif op == _STORE:
            stack.append(mind.store(thing, program[at + 1], argument))
        elif op == _OPERATE:
            stack.append(mind.operate(thing, program[at + 1]))
        elif op == _REPORT:
            arguments = _taken(stack, argument)
            mind.report(thing, arguments)
            stack.append(arguments[-1] if arguments else 1.0)
        elif op == _PROB:
            if stack[-1] is not None:
                stack[-1] = 1.0 if mind.draw() < stack[-1] else 0.0
        elif op == _DICE:
            stack.append(mind.draw())
            stack.append(0.0)
        elif op == _UNKNOWN_SIDE:
            if stack[-1] is None:
                del stack[-2:]
                stack[-1] = None
                pc = argument
        elif op == _SIDE:
            value = stack.pop()
            stack[-1] += value
            if stack[-2] < stack[-1]:
                del stack[-2:]
            else:
                pc = argument
        elif op == _NONE:
            stack.pop()
            stack[-1] = 0.0
        elif op == _RANDOM or op == _GAUSS:
            y = stack.pop()
            stack[-1] = chance(mind, op == _GAUSS, stack[-1], y)
        elif op == _FLAG:
            mind.put(argument >> 1, float(argument & 1))
            stack.append(1.0)
        elif op == _UNKNOWN:
            stack.append(None)
        elif op < _ASSIGN:
            mind.act(op - _ACTS, thing, stack)
        else:
            stack.append(tell(mind, thing, _taken(stack, len(thing) - 1), argument))


def _taken(stack, count):
    """The upper values of the stack, taken off it."""
    if not count:
        return []
    values = stack[-count:]
    del stack[-count:]
    return values


def chance(mind, on, x, y):
    if x is None or y is None:
        return None
    if not on:
        return _finite(mind, x + mind.draw() * (y - x))
    from sleepnode.gauss import normal  # rarely used, so loaded when it is

    if y < 0:
        return mind.fault("deviation of %s: it cannot be negative" % general(y))
    return _finite(mind, x + y * normal(mind.draw()))


def tell(mind, pieces, values, hops):
    if None in values:
        return mind.fault("an unknown cannot be told")
    text = pieces[0]
    for at, value in enumerate(values):
        text += format_number(value) + pieces[at + 1]
    mind.tell(text, hops)
    return 1.0

"""The machine: runs a program on a robot's memory.

Values lie on one stack and entered programs in a list, so nothing here calls itself, however deeply texts are nested:
the stack of a small computer's own interpreter is short. Unknown is None: like 0, it is not true.
"""

import math

from micropython import const

from sleepnode.functions import Undefined
from sleepnode.instructions import height_of, is_tested, places_of
from sleepnode.reader import format_number

_MAX_STEPS = const(10000)
_MAX_DEPTH = const(32)
_MAX_LEVELS = const(100)
_COST = const(0)
_FIRST = const(3)


# The numbers of `instructions.number_of`, as constants that cost no look-up.
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
_ZERO = const(13)
_ASSIGN = const(14)
_LOCAL = const(15)
_RETURN = const(16)
_ENTER = const(17)
_CALL = const(18)
_OPERATOR = const(19)
_MATCH = const(20)
_MATCH_IF = const(21)
_ELSE_TEST = const(22)
_AND_TEST = const(23)
_ANY = const(24)
_OR = const(25)
_OR_TEST = const(26)
_KNOWN = const(27)
_TAKE = const(28)
_KEEP = const(29)
_REPEAT = const(30)
_NEXT = const(31)
_HOST = const(32)
_DEFINED = const(33)
_STORE = const(34)
_OPERATE = const(35)
_REPORT = const(36)
_TELL = const(37)
_PROB = const(38)
_DICE = const(39)
_UNKNOWN_SIDE = const(40)
_SIDE = const(41)
_NONE = const(42)
_RANDOM = const(43)
_GAUSS = const(44)
_FLAG = const(45)


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


def run(mind, program):
    """The value of a program, with all its effects. Leaves in the mind: matched, undecided, steps and faults."""
    mind.matched, mind.undecided = not is_tested(program), False
    mind.steps, levels = program[_COST], height_of(program)
    code, local, pc = program, [None] * places_of(program), _FIRST
    stack, frames, values = [], [], mind.values
    while True:
        op = code[pc]
        pc += 1
        argument = op >> 6
        op &= 63
        if op == _VARIABLE:
            stack.append(values[argument])
        elif op == _CONSTANT:
            stack.append(code[pc])
            pc += 1
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
            stack.append(_pure(mind, code[pc], _taken(stack, argument)))
            pc += 1
        elif op == _WRITE:
            stack[-1] = mind.write(argument, stack[-1])
        elif op == _JUMP:
            pc = argument
        elif op == _POP:
            stack.pop()
        elif op == _ZERO:
            stack.append(0.0)
        elif op == _ASSIGN:
            stack[-1] = mind.assign(code[pc], stack[-1])
            pc += 1
        elif op == _LOCAL:
            stack.append(local[argument])
        elif op == _RETURN:
            if not frames:
                return stack[-1]
            levels -= frames.pop()
            local, pc, code = frames.pop(), frames.pop(), frames.pop()
        elif op == _ENTER or op == _CALL:
            if op == _CALL:
                arguments = _taken(stack, argument)
                found = mind.operator(code[pc], argument)
            else:
                arguments = ()
                found = mind.expression(code[pc])
            pc += 1
            if not isinstance(found, tuple):
                stack.append(found)
                continue
            tall = height_of(found)
            if len(frames) >= 4 * _MAX_DEPTH or levels + tall > _MAX_LEVELS:
                stack.append(mind.fault("calls nested too deeply: at most %d" % _MAX_DEPTH))
                continue
            mind.steps += found[_COST]
            if mind.steps > _MAX_STEPS:
                return mind.fault("out of steps: at most %d in one evaluation" % _MAX_STEPS)
            frames.append(code)
            frames.append(pc)
            frames.append(local)
            frames.append(tall)
            levels += tall
            code, pc = found, _FIRST
            local = list(arguments) + [None] * (places_of(found) - len(arguments))
        elif op == _OPERATOR:
            if mind.operator(code[pc], argument, code[pc + 1]) is None:
                stack.append(None)
                pc += 2
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
            if local[code[pc]] >= code[pc + 1]:
                pc = argument
            else:
                pc += 2
        elif op == _NEXT:
            local[code[pc]] += 1.0
            pc = argument
        elif op == _HOST:
            stack.append(mind.host(code[pc], code[pc + 1], _taken(stack, argument)))
            pc += 2
        elif op == _DEFINED:
            if code[pc] in mind.learned:
                stack.append(mind.value_of(code[pc]))
                pc = argument
            else:
                pc += 1
        elif op == _STORE or op == _OPERATE:
            if op == _STORE:
                stack.append(mind.store(code[pc], code[pc + 1], argument))
            else:
                stack.append(mind.operate(code[pc], code[pc + 1]))
            pc += 2
        elif op == _REPORT:
            arguments = _taken(stack, argument)
            mind.report(code[pc], arguments)
            pc += 1
            stack.append(arguments[-1] if arguments else 1.0)
        elif op == _TELL:
            pieces = code[pc]
            pc += 1
            stack.append(tell(mind, pieces, _taken(stack, len(pieces) - 1), argument))
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
            values[argument >> 1] = float(argument & 1)
            stack.append(1.0)
        else:
            pc = mind.act(op - _FLAG, code, pc, stack)


def _taken(stack, count):
    """The upper values of the stack, taken off it."""
    if not count:
        return []
    found = stack[-count:]
    del stack[-count:]
    return found


def chance(mind, on, x, y):
    if x is None or y is None:
        return None
    if not on:
        return _finite(mind, x + mind.draw() * (y - x))
    from sleepnode.gauss import normal  # rarely used, so loaded when it is

    if y < 0:
        return mind.fault("deviation of %g: it cannot be negative" % y)
    return _finite(mind, x + y * normal(mind.draw()))


def tell(mind, pieces, values, hops):
    if None in values:
        return mind.fault("an unknown cannot be told")
    text = pieces[0]
    for at, value in enumerate(values):
        written = format_number(value)
        text += ("-0.0" if written == "0" and math.copysign(1.0, value) < 0 else written) + pieces[at + 1]
    mind.tell(text, hops)
    return 1.0

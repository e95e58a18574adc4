"""The robots of many worlds as rows, world by world: what they are to do is written into their own arrays, and what
they have sensed is gathered from there. See `rows`, which makes the table of addresses."""

from __future__ import annotations

from sleepcast.simulator.motion.driving import DRIVE
from sleepcast.simulator.quiet.layout import HALTED, MEASURED, MODES, ROBOTS, SIZE, SPEEDS, TURNS
from sleepcast.simulator.simd.compiled import strict
from sleepcast.simulator.simd.memory import byte, put_byte, put_real, real, word


@strict
def drive(table, speeds, turns, first, last):
    """Let robots drive, but those that are stopped. speeds, turns: m/s and rad/s, a number for each row; of no length:
    nothing is wanted of that."""
    for number in range(first, last):
        w = table[number]
        row = word(w, ROBOTS)
        for i in range(word(w, SIZE)):
            if byte(word(w, HALTED), i):
                continue
            put_byte(word(w, MODES), i, DRIVE)
            if len(speeds):
                put_real(word(w, SPEEDS), i, speeds[row + i])
            if len(turns):
                put_real(word(w, TURNS), i, turns[row + i])


@strict
def gather(table, sensed, first, last):
    """Copy what robots have sensed into a table of shape (sensors, rows)."""
    for number in range(first, last):
        w = table[number]
        row, count = word(w, ROBOTS), word(w, SIZE)
        for sensor in range(len(sensed)):
            for i in range(count):
                sensed[sensor, row + i] = real(word(w, MEASURED), sensor * count + i)

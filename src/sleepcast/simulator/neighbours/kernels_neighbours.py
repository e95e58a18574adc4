"""Compiled kernels, with numba, that find for each robot what it senses of its neighbours, without arrays of pairs.

They go through the neighbours in the order in which `grid.pairs` gives them, and compute with the formulas of
`pairs.Pairs`: sums have the same bits. Where everything lies they read in the tables of `neighbourhood`.

On the plane neighbours lie in a disc, where something flies in a ball. The same code is compiled for both: what only
the ball needs is left out where `ball` is None.
"""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np

from sleepcast.core.angles import CANCELLED
from sleepcast.simulator.neighbours import kernels_field, neighbourhood
from sleepcast.simulator.neighbours.neighbourhood import (
    ANGLE,
    AWAY,
    DIRECTION,
    DX,
    DY,
    DZ,
    FROM_X,
    FROM_Y,
    FROM_Z,
    HEADING,
    LEAST,
    LISTED,
    MEAN,
    MOST,
    NEAREST,
    ONE,
    OUTLIER,
    TOTAL,
    VALUE,
)
from sleepcast.simulator.simd.compiled import part, strict, woven
from sleepcast.simulator.simd.formulas import LANES, arc_tangent, sine_cosine, square_within, wrap
from sleepcast.simulator.simd.lanes import (
    long_at,
    pack_at,
    put_long,
    put_real,
    put_reals,
    put_whole,
    real_at,
    reals_at,
    single_at,
    singles_at,
    stack_room,
    whole_at,
    wholes_at,
)
from sleepcast.simulator.simd.vectors import any_of, either, every, how_many, least_of, places, singles
from sleepcast.simulator.sonar.kernels import GOLDEN, U, cells_around, deviate, mixed
from sleepcast.simulator.world import kernels_sight

I = np.int32  # noqa: E741  # as short as U
AT_ONCE = 128
"""Neighbours that are found before something is asked about them."""
ROW = AT_ONCE + LANES
ROOM, WAYS = ROW // 2, ROW
"""Words for their indices, 32 bits each, with room for LANES more; and for two such rows."""
SEEN = kernels_sight.SEEN
(
    COUNT,
    PLACE_X,
    PLACE_Y,
    TRUE_HEADING,
    SENSED_X,
    SENSED_Y,
    SENSED_HEADING,
    SHARED,
    SHARED_NEXT,
    SHARES,
    TURNED,
    TORUS,
    WIDTH,
    HEIGHT,
    LOSS,
    NOISE,
    LOST_KEY,
    ACROSS_KEY,
    UP_KEY,
    ABOVE_KEY,
    COSINE,
    SINE,
    TURNING,
    SIGHT,
    PLACE_Z,
    SENSED_Z,
    OWN_X,
    OWN_Y,
    OWN_HEADING,
    OWN_Z,
    *_,
    VICINITIES,
    FIRST,
) = map(int, neighbourhood.Near)
(
    AROUND,
    STALE,
    REACH,
    SIZE,
    COLUMNS,
    ROWS,
    MARGIN,
    X,
    Y,
    WHOSE,
    CELL,
    START,
    ORDER,
    SORTED_WHOSE,
    SORTED_X,
    SORTED_Y,
    WALLS,
    LAYERS,
    SORTED_Z,
) = map(int, neighbourhood.Of)


# ---- sorting


@strict
def begin(near):
    """Bodies have moved: show what they have shared in the last tick, and prepare all vicinities that are kept up to
    date."""
    shared, following = long_at(near, SHARED), long_at(near, SHARED_NEXT)
    for i in range(long_at(near, SHARES)):
        put_real(shared, i, real_at(following, i))
    for i in range(long_at(near, VICINITIES)):
        put_long(long_at(near, FIRST + i), STALE, 1)
    prepare(near)


@strict
def prepare(near):
    """Prepare all vicinities that are kept up to date and are not."""
    for i in range(long_at(near, VICINITIES)):
        prepare_one(long_at(near, FIRST + i))


@strict
def prepare_one(vicinity):
    """Sort all bodies into the cells of a vicinity, as `grid.sort` does, if they have moved; and compute the cosines
    and sines of their headings, if anybody wants them."""
    if not long_at(vicinity, STALE):
        return
    near = long_at(vicinity, AROUND)
    points = place_points(vicinity, near)
    sort_points(vicinity, points)
    if long_at(near, TURNING):
        turn(long_at(near, TRUE_HEADING), long_at(near, COUNT), long_at(near, COSINE), long_at(near, SINE))
    put_long(vicinity, STALE, 0)


@part
def turn(heading, count, cosines, sines):
    """Cosines and sines of so many headings."""
    for i in range(count):
        sine, cosine = sine_cosine(real_at(heading, i))
        put_real(cosines, i, cosine)
        put_real(sines, i, sine)


@part
def place_points(vicinity, near):
    """Write all bodies and their images into the vicinity, see `torus.Cells.images`; gives their number."""
    x, y, whose, count = long_at(vicinity, X), long_at(vicinity, Y), long_at(vicinity, WHOSE), long_at(near, COUNT)
    place_x, place_y = long_at(near, PLACE_X), long_at(near, PLACE_Y)
    margin = real_at(vicinity, MARGIN) if long_at(near, TORUS) else 0.0
    for i in range(count):
        put_real(x, i, real_at(place_x, i) + margin)
        put_real(y, i, real_at(place_y, i) + margin)
        put_whole(whose, i, I(i))
    if long_at(near, TORUS):
        count = copy_points(x, y, whose, count, margin, real_at(near, WIDTH))
        count = copy_points(y, x, whose, count, margin, real_at(near, HEIGHT))
    return count


@part
def copy_points(along, across, whose, count, margin, size):
    """Append the images of so many points across both ends of one axis; gives the number of all. Each is written,
    and then overwritten unless it counts: faster than a branch that is hard to predict."""
    total = count
    for i in range(count):
        place = real_at(along, i)
        put_real(along, total, place + size)
        put_real(across, total, real_at(across, i))
        put_whole(whose, total, whole_at(whose, i))
        total += place < 2.0 * margin
    for i in range(count):
        place = real_at(along, i)
        put_real(along, total, place - size)
        put_real(across, total, real_at(across, i))
        put_whole(whose, total, whole_at(whose, i))
        total += place >= size
    return total


@part
def sort_points(vicinity, points):
    """A counting sort of so many points by cell."""
    x, y, cell, start = long_at(vicinity, X), long_at(vicinity, Y), long_at(vicinity, CELL), long_at(vicinity, START)
    columns, rows, size = long_at(vicinity, COLUMNS), long_at(vicinity, ROWS), real_at(vicinity, SIZE)
    order, whose, its = long_at(vicinity, ORDER), long_at(vicinity, WHOSE), long_at(vicinity, SORTED_WHOSE)
    sorted_x, sorted_y = long_at(vicinity, SORTED_X), long_at(vicinity, SORTED_Y)
    layers, place_z = long_at(vicinity, LAYERS), long_at(long_at(vicinity, AROUND), PLACE_Z)
    cells = columns * rows * layers
    for i in range(cells + 2):
        put_whole(start, i, I(0))
    for i in range(points):
        column = min(max(int(real_at(x, i) / size), 0), columns - 1)
        row = min(max(int(real_at(y, i) / size), 0), rows - 1)
        put_whole(cell, i, I(row * columns + column))
    if layers > 1:
        for i in range(points):
            layer = min(max(int(height_of(place_z, whole_at(whose, i)) / size), 0), layers - 1)
            put_whole(cell, i, I(whole_at(cell, i) + layer * rows * columns))
    for i in range(points):
        here = whole_at(cell, i)
        put_whole(start, here + 2, I(whole_at(start, here + 2) + 1))
    total = 0
    for i in range(2, cells + 2):  # until all are placed, each cell's beginning is one further
        total += whole_at(start, i)
        put_whole(start, i, I(total))
    for i in range(points):
        here = whole_at(cell, i) + 1
        at = whole_at(start, here)
        put_whole(start, here, I(at + 1))
        put_whole(order, at, I(i))
        put_whole(its, at, whole_at(whose, i))
        put_real(sorted_x, at, real_at(x, i))
        put_real(sorted_y, at, real_at(y, i))
    if place_z:
        sorted_z = long_at(vicinity, SORTED_Z)
        for at in range(points):
            put_real(sorted_z, at, height_of(place_z, whole_at(its, at)))


@woven
def height_of(place_z, robot):
    """The z of a robot, m; what does not fly is at 0."""
    z = real_at(place_z, np.int64(robot))
    return z if z == z else 0.0


# ---- asking


@strict
def ask_many(vicinity, quantity, fold, frame, row, robots, radius, colour, order, first, last, found):
    """Write what `formula` comes to for the robots from `first` to `last` (exclusive) in an order of them into `found`.
    radius: m, one for each; colour: likewise, NaN for any; order: indices of all of these."""
    ask_each(vicinity, None, quantity, fold, frame, row, robots, radius, colour, order, first, last, found)


@strict
def ask_many_in_ball(vicinity, quantity, fold, frame, row, robots, radius, colour, order, first, last, found):
    """As `ask_many`, where something flies."""
    ask_each(vicinity, True, quantity, fold, frame, row, robots, radius, colour, order, first, last, found)


@woven
def ask_each(vicinity, ball, quantity, fold, frame, row, robots, radius, colour, order, first, last, found):
    """See `ask_many`."""
    before, within = -1.0, 0.0
    for index in range(first, last):
        i = order[index]
        if radius[i] != before:
            before = radius[i]
            within = square_within(before)
        found[i] = ask(vicinity, ball, quantity, fold, frame, row, robots[i], within, colour[i])


@strict
def list_many(vicinity, robots, radius, colour, counts, listed, room):
    """Write the number of neighbours of each of the robots into `counts`, and all of these neighbours to the address
    `listed`, each as a number of 64 bits: below the robot's, in the upper half, that of the neighbour; as `ask_many`.
    Gives how many they are, or -1 as soon as there are more than `room`; a robot's are written before that is seen."""
    return list_each(vicinity, None, robots, radius, colour, counts, listed, room)


@strict
def list_many_in_ball(vicinity, robots, radius, colour, counts, listed, room):
    """As `list_many`, where something flies."""
    return list_each(vicinity, True, robots, radius, colour, counts, listed, room)


@woven
def list_each(vicinity, ball, robots, radius, colour, counts, listed, room):
    """See `list_many`."""
    total = 0
    for i in range(len(robots)):
        within = square_within(radius[i])
        _, _, count, _ = gather(
            vicinity, ball, DX, LISTED, 0, robots[i], within, colour[i], 0.0, 0.0, listed + 8 * total
        )
        counts[i] = np.int64(count)
        total += counts[i]
        if total > room:
            return -1
    return total


@strict
def ask_lanes(question, first, mask, lanes, numbers, found):
    """What a `neighbourhood.question` comes to for the robots from `first` on whose bits are set in `mask`, into the
    numbers at `found`, of which there are as many as `lanes`. numbers: the radii as they were written; the question has
    the square, within the reach of the sensor."""
    answer(question, None, first, mask, lanes, 0, found)


@strict
def ask_coloured(question, first, mask, lanes, numbers, found):
    """The same of neighbours of one colour for each, which follow the radii."""
    answer(question, None, first, mask, lanes, numbers + 8 * lanes, found)


@strict
def ask_lanes_in_ball(question, first, mask, lanes, numbers, found):
    """As `ask_lanes`, where something flies."""
    answer(question, True, first, mask, lanes, 0, found)


@strict
def ask_coloured_in_ball(question, first, mask, lanes, numbers, found):
    """As `ask_coloured`, where something flies."""
    answer(question, True, first, mask, lanes, numbers + 8 * lanes, found)


@part
def answer(question, ball, first, mask, lanes, colours, found):
    """See `ask_lanes`. colours: where they lie, 0 for any."""
    vicinity, quantity, fold = long_at(question, 0), long_at(question, 1), long_at(question, 2)
    frame, row, within = long_at(question, 3), long_at(question, 4), real_at(question, 5)
    if fold == DIRECTION:
        directions(vicinity, ball, quantity, row, first, mask, lanes, within, colours, found)
        return
    for lane in range(lanes):
        if mask >> lane & 1:
            colour = real_at(colours, lane) if colours else nan
            put_real(found, lane, ask(vicinity, ball, quantity, fold, frame, row, first + lane, within, colour))


@part
def directions(vicinity, ball, quantity, row, first, mask, lanes, within, colours, found):
    """The same as `ask` for directions, which are computed side by side."""
    sums, others, counts = stack_room(LANES), stack_room(LANES), stack_room(LANES)
    for lane in range(LANES):
        total, other, count = 0.0, 0.0, 0.0
        if lane < lanes and mask >> lane & 1:
            colour = real_at(colours, lane) if colours else nan
            total, other, count, _ = gather(
                vicinity, ball, quantity, DIRECTION, row, first + lane, within, colour, 0.0, 0.0, 0
            )
        put_real(sums, lane, total)
        put_real(others, lane, other)
        put_real(counts, lane, count)
    x, y, count = reals_at(sums, 0), reals_at(others, 0), reals_at(counts, 0)
    known = np.sqrt(x * x + y * y) > CANCELLED * count
    put_reals(sums, 0, either(known, arc_tangent(y, x), nan))
    for lane in range(lanes):
        put_real(found, lane, real_at(sums, lane))


@part
def ask(vicinity, ball, quantity, fold, frame, row, robot, within, colour):
    """What a formula comes to for one robot, NaN for unknown. within: see `square_within`."""
    if fold == OUTLIER:
        # Not as literals, for each of which numba would compile `gather` once more.
        across_x, across_y, total, none = np.int64(DX), np.int64(DY), np.int64(TOTAL), np.int64(0)
        across, _, count, _ = gather(vicinity, ball, across_x, total, none, robot, within, colour, 0.0, 0.0, 0)
        up, _, _, _ = gather(vicinity, ball, across_y, total, none, robot, within, colour, 0.0, 0.0, 0)
        least = max(count, 1.0)
        found, _, count, _ = gather(
            vicinity, ball, quantity, fold, none, robot, within, colour, across / least, up / least, 0
        )
    else:
        found, other, count, best = gather(vicinity, ball, quantity, fold, row, robot, within, colour, 0.0, 0.0, 0)
        if fold == MEAN:
            found = found / max(count, 1.0)
        elif fold == DIRECTION:
            if not sqrt(found * found + other * other) > CANCELLED * count:
                return nan
            return arc_tangent(other, found)
        elif fold in (LEAST, MOST):
            found = -best if fold == LEAST else best
    if count == 0.0 and fold != TOTAL:
        return nan
    near = long_at(vicinity, AROUND)
    if frame == FROM_X:
        return real_at(long_at(near, SENSED_X), robot) + found
    if frame == FROM_Y:
        return real_at(long_at(near, SENSED_Y), robot) + found
    if ball is not None and frame == FROM_Z:
        return real_at(long_at(near, SENSED_Z), robot) + found
    return found


@part
def gather(vicinity, ball, quantity, fold, row, robot, within, colour, middle_x, middle_y, listed):
    """Fold a quantity of all neighbours of one robot. Gives the sum, or the value of the neighbour that is nearest, or
    farthest from the middle; the sum of the sines, where the other one is of cosines; how many they are; and the
    greatest value, or of LEAST the greatest negative one. listed: where LISTED writes them, see `list_many`."""
    near = long_at(vicinity, AROUND)
    margin = real_at(vicinity, MARGIN) if long_at(near, TORUS) else 0.0
    own_x, own_y = real_at(long_at(near, OWN_X), robot) + margin, real_at(long_at(near, OWN_Y), robot) + margin
    size, columns, reach = real_at(vicinity, SIZE), long_at(vicinity, COLUMNS), real_at(vicinity, REACH)
    order, start, whose = long_at(vicinity, ORDER), long_at(vicinity, START), long_at(vicinity, SORTED_WHOSE)
    sorted_x, sorted_y = long_at(vicinity, SORTED_X), long_at(vicinity, SORTED_Y)
    shared, robots, loss, noise = long_at(near, SHARED), long_at(near, COUNT), real_at(near, LOSS), real_at(near, NOISE)
    coloured, turned, sine, cosine = colour == colour, long_at(near, TURNED), 0.0, 1.0
    if turned:
        sensed = real_at(long_at(near, SENSED_HEADING), robot)
        sine, cosine = sine_cosine(wrap(sensed - real_at(long_at(near, OWN_HEADING), robot)))
    cosines, sines = long_at(near, COSINE), long_at(near, SINE)
    least = within if within < reach * reach else reach * reach
    plain = not coloured and loss == 0.0
    measured = noise > 0.0 or quantity == AWAY or fold == NEAREST
    seen = stack_room(SEEN)
    walls, discs = around(vicinity, near, robot, least, seen)
    veiled, narrow = walls != 0 or discs != 0, kernels_field.is_narrow(near)
    found, other_found, count, best = 0.0, 0.0, 0.0, -inf
    counts = quantity == ONE and fold == TOTAL
    near_only = counts or (quantity == AWAY and fold == NEAREST and noise == 0.0)
    merely, nearest = near_only and plain and not (veiled or narrow), every(inf)
    line, high, left, right = cells_around(own_x, own_y, size, columns, long_at(vicinity, ROWS), reach)
    own_z, sorted_z, last, rows, span = 0.0, 0, high, 0, 0
    if ball is not None:
        own_z, sorted_z = height_of(long_at(near, OWN_Z), robot), long_at(vicinity, SORTED_Z)
        rows, span = long_at(vicinity, ROWS), high - line
        bottom, top = layers_around(own_z, size, long_at(vicinity, LAYERS), reach)
        line, high, last = line + bottom * rows, high + bottom * rows, high + top * rows
    room, ways, k = stack_room(ROOM), stack_room(WAYS), np.int64(whole_at(start, line * columns + left))
    while line < high:
        taken = 0
        while line < high and taken < AT_ONCE:
            stop = whole_at(start, line * columns + right)
            end = min(stop, k + AT_ONCE - taken)
            for each in range(k, end, LANES):
                dx, dy = reals_at(sorted_x, each) - own_x, reals_at(sorted_y, each) - own_y
                squares = dx * dx + dy * dy
                if ball is not None:
                    dz = reals_at(sorted_z, each) - own_z
                    squares = squares + dz * dz
                close = (squares <= least) & (wholes_at(order, each) != I(robot))
                close = close & (places() < I(end - each))
                if merely:  # who the neighbours are does not matter
                    count += float(how_many(close))
                    nearest = least_of(nearest, either(close, squares, inf))
                    continue
                pack_at(room, taken, places() + I(each), close)
                if veiled:
                    pack_at(ways, taken, singles(dx), close)
                    pack_at(ways, taken + ROW, singles(dy), close)
                taken += np.int64(how_many(close))
            k = end
            if k == stop:
                line += 1
                if ball is not None:  # the first row of the next layer
                    above = line == high and high < last
                    line, high = (line + rows - span, high + rows) if above else (line, high)
                k = np.int64(whole_at(start, min(line, high - 1) * columns + left))
        if veiled and taken > 0:
            taken = visible(vicinity, near, robot, seen, walls, discs, room, ways, taken)
        if narrow:
            taken = kernels_field.in_field(vicinity, ball, near, robot, (own_x, own_y, own_z), room, taken)
        if plain and counts:
            found, count = found + float(taken), count + float(taken)
            continue
        if plain and quantity == HEADING and fold == DIRECTION and not turned:
            for index in range(taken):
                other = np.int64(whole_at(whose, np.int64(whole_at(room, index))))
                found, other_found = found + real_at(cosines, other), other_found + real_at(sines, other)
            count += float(taken)
            continue
        for index in range(taken):
            at = np.int64(whole_at(room, index))
            dx, dy = real_at(sorted_x, at) - own_x, real_at(sorted_y, at) - own_y
            squares, dz, other = dx * dx + dy * dy, 0.0, np.int64(whole_at(whose, at))
            if ball is not None:
                dz = real_at(sorted_z, at) - own_z
                squares = squares + dz * dz
            away = sqrt(squares) if measured else 0.0
            if coloured and real_at(shared, other) != colour:
                continue
            if loss > 0.0 or noise > 0.0:
                multiple = ((U(other) << U(32)) + U(robot)) * GOLDEN
                if loss > 0.0:
                    drawn = float(mixed(multiple, U(long_at(near, LOST_KEY))) >> U(11)) * 2.0**-53
                    if drawn < loss:
                        continue
                if noise > 0.0:
                    wide = noise * away
                    dx = dx + wide * deviate(mixed(multiple, U(long_at(near, ACROSS_KEY))))
                    dy = dy + wide * deviate(mixed(multiple, U(long_at(near, UP_KEY))))
                    squares = dx * dx + dy * dy
                    if ball is not None:
                        dz = dz + wide * deviate(mixed(multiple, U(long_at(near, ABOVE_KEY))))
                        squares = squares + dz * dz
                    away = sqrt(squares)
            if fold == LISTED:
                put_long(listed, np.int64(count), robot << 32 | other)
                count += 1.0
                continue
            if turned:
                dx, dy = dx * cosine - dy * sine, dx * sine + dy * cosine
            value, across = 1.0, 0.0
            if quantity == DX:
                value = dx
            elif quantity == DY:
                value = dy
            elif quantity == DZ:
                value = dz
            elif quantity == AWAY:
                value = away
            elif quantity == HEADING:
                value, across = real_at(cosines, other), real_at(sines, other)
                if turned:
                    value, across = value * cosine - across * sine, value * sine + across * cosine
            elif quantity in (VALUE, ANGLE):
                value = real_at(shared, row * robots + other)
                if value != value:
                    continue
                if quantity == ANGLE:
                    across, value = sine_cosine(wrap(value))
            count += 1.0
            if fold in (TOTAL, MEAN, DIRECTION):
                found, other_found = found + value, other_found + across
            elif fold in (LEAST, MOST):
                value = -value if fold == LEAST else value
                best = best if best > value else value  # of 0 and -0 the later one, as NumPy
            else:
                key = -away
                if fold == OUTLIER:
                    dx, dy = dx - middle_x, dy - middle_y
                    key = sqrt(dx * dx + dy * dy)
                if key > best:
                    found, best = value, key
    if merely:
        found = count if counts else least_in(np.sqrt(nearest))
    return found, other_found, count, best


@woven
def least_in(values):
    """The least of LANES numbers."""
    room, least = stack_room(LANES), inf
    put_reals(room, 0, values)
    for lane in range(LANES):
        least = min(least, real_at(room, lane))
    return least


@woven
def layers_around(z, size, layers, reach):
    """The layers of cells within `reach` m of a height: the first and the last one."""
    layer, cells = min(max(int(z / size), 0), layers - 1), int(np.ceil(reach / size))
    return max(layer - cells, 0), min(layer + cells, layers - 1)


@part
def around(vicinity, near, robot, within, seen):
    """What hides neighbours around a robot, see `kernels_sight.look_around`; walls are -1 where each line has to be
    walked along."""
    if long_at(long_at(near, SIGHT), kernels_sight.COUNT) == 0:
        return 0, 0
    walls = long_at(vicinity, WALLS)
    if walls == 0:
        return -1, 0
    x, y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    return kernels_sight.look_around(walls, x, y, within, seen)


@part
def visible(vicinity, near, robot, seen, walls, discs, room, ways, taken):
    """Keep those of so many points in a room that nothing hides from a robot; gives their number. seen, walls, discs:
    see `around`; ways: x and y of the way to each point, float32, in two rows"""
    if walls < 0:
        return walked(vicinity, near, robot, room, 0, taken, 0)
    kept, doubt, depths = 0, np.float32(real_at(long_at(vicinity, WALLS), kernels_sight.DOUBT)), stack_room(LANES)
    for first in range(0, taken, LANES):
        depth = kernels_sight.depth(seen, walls, discs, singles_at(ways, first), singles_at(ways, first + ROW))
        there = places() < I(taken - first)
        if any_of(there & (np.abs(depth) <= doubt)):
            put_reals(depths, 0, depth)
            for index in range(first, min(first + LANES, taken)):
                one = single_at(depths, index - first)
                if abs(one) <= doubt:
                    kept = walked(vicinity, near, robot, room, index, index + 1, kept)
                else:
                    put_whole(room, kept, whole_at(room, index))
                    kept += one < np.float32(0.0)
        else:
            clear = there & (depth < np.float32(0.0))
            pack_at(room, kept, wholes_at(room, first), clear)
            kept += np.int64(how_many(clear))
    return kept


@part
def walked(vicinity, near, robot, room, first, last, kept):
    """Keep those points in a room from `first` to `last` (exclusive) that nothing hides, after so many that are kept;
    gives their number together. For each one the cells between are looked at."""
    x, y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    for index in range(first, last):
        point = whole_at(room, index)
        seen_x, seen_y = place_of(vicinity, near, x, y, np.int64(point))
        put_whole(room, kept, point)
        kept += not kernels_sight.hidden(long_at(near, SIGHT), x, y, seen_x, seen_y)
    return kept


@woven
def place_of(vicinity, near, x, y, point):
    """Where a sorted point is seen from x, y, in the world's frame."""
    if not long_at(near, TORUS):
        return real_at(long_at(vicinity, SORTED_X), point), real_at(long_at(vicinity, SORTED_Y), point)
    other = np.int64(whole_at(long_at(vicinity, SORTED_WHOSE), point))
    seen_x, seen_y = real_at(long_at(near, PLACE_X), other), real_at(long_at(near, PLACE_Y), other)
    return unrolled(x, seen_x, real_at(near, WIDTH)), unrolled(y, seen_y, real_at(near, HEIGHT))


@part
def unrolled(place, seen, around):
    """See `sight.unrolled`."""
    way, half = seen - place, around / 2.0
    return seen - around if way > half else (seen + around if way < -half else seen)

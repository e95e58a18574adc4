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
from sleepcast.simulator.neighbours.kernels_field import AT_ONCE, ROOM, ROW, WAYS, I, around, visible
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
from sleepcast.simulator.simd.formulas import LANES, arc_tangent, rotated, sine_cosine, square_within, wrap
from sleepcast.simulator.simd.lanes import (
    long_at,
    pack_at,
    put_long,
    put_real,
    put_reals,
    put_whole,
    real_at,
    reals_at,
    stack_room,
    whole_at,
    wholes_at,
)
from sleepcast.simulator.simd.vectors import either, every, how_many, least_of, places, singles
from sleepcast.simulator.sonar.kernels import GOLDEN, U, cells_around, deviate, mixed
from sleepcast.simulator.world import kernels_sight

SEEN = kernels_sight.SEEN
NOWHERE = (0.0, 0.0)
"""The middle of those for whom it is not asked."""
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
        here, within = listed + 8 * total, square_within(radius[i])
        _, _, count, _ = gather(vicinity, ball, DX, LISTED, 0, robots[i], within, colour[i], NOWHERE, here)
        counts[i] = np.int64(count)
        total += counts[i]
        if total > room:
            return -1
    return total


@strict
def ask_lanes(question, first, mask, lanes, numbers, found):
    """What a `neighbourhood.question` comes to for the robots from `first` on whose bits are set in `mask`, into the
    numbers at `found`, of which there are as many as `lanes`. numbers: the radii as they were written, and the colours
    if it asks for neighbours of one for each; the question has the square, within the reach of the sensor."""
    answer(question, None, first, mask, lanes, numbers, found)


@strict
def ask_lanes_in_ball(question, first, mask, lanes, numbers, found):
    """As `ask_lanes`, where something flies."""
    answer(question, True, first, mask, lanes, numbers, found)


@part
def answer(question, ball, first, mask, lanes, numbers, found):
    """See `ask_lanes`."""
    vicinity, quantity, fold = long_at(question, 0), long_at(question, 1), long_at(question, 2)
    frame, row, within = long_at(question, 3), long_at(question, 4), real_at(question, 5)
    colours = numbers + 8 * lanes if long_at(question, 6) else 0
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
            robot, colour = first + lane, real_at(colours, lane) if colours else nan
            total, other, count, _ = gather(vicinity, ball, quantity, DIRECTION, row, robot, within, colour, NOWHERE, 0)
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
    middle = NOWHERE
    if fold == OUTLIER:
        dx, count = sum_of(vicinity, ball, DX, robot, within, colour)
        dy, _ = sum_of(vicinity, ball, DY, robot, within, colour)
        middle = dx / max(count, 1.0), dy / max(count, 1.0)
    found, other, count, best = gather(vicinity, ball, quantity, fold, row, robot, within, colour, middle, 0)
    if fold == DIRECTION:
        return arc_tangent(other, found) if sqrt(found * found + other * other) > CANCELLED * count else nan
    if count == 0.0 and fold != TOTAL:
        return nan
    if fold == MEAN:
        found = found / count
    elif fold in (LEAST, MOST):
        found = -best if fold == LEAST else best
    near = long_at(vicinity, AROUND)
    if frame == FROM_X:
        return real_at(long_at(near, SENSED_X), robot) + found
    if frame == FROM_Y:
        return real_at(long_at(near, SENSED_Y), robot) + found
    if ball is not None and frame == FROM_Z:
        return real_at(long_at(near, SENSED_Z), robot) + found
    return found


@part
def sum_of(vicinity, ball, quantity, robot, within, colour):
    """The sum of a quantity of all neighbours of one robot, and how many they are."""
    total, _, count, _ = gather(vicinity, ball, quantity, TOTAL, 0, robot, within, colour, NOWHERE, 0)
    return total, count


@woven
def gather(vicinity, ball, quantity, fold, row, robot, within, colour, middle, listed):
    """Fold a quantity of all neighbours of one robot. Gives the sum, or the value of the neighbour that is nearest, or
    farthest from the middle; the sum of the sines, where the other one is of cosines; how many they are; and the
    greatest value, or of LEAST the greatest negative one. listed: where LISTED writes them, see `list_many`."""
    near, reach = long_at(vicinity, AROUND), real_at(vicinity, REACH)
    least, seen = within if within < reach * reach else reach * reach, stack_room(SEEN)
    walls, discs = around(vicinity, near, robot, least, seen)
    veiled, narrow = walls != 0 or discs != 0, kernels_field.is_narrow(near)
    points, chance, turn = points_of(vicinity, ball), chance_of(near), turn_of(near, robot)
    plain = colour != colour and chance[0] == 0.0
    counts = quantity == ONE and fold == TOTAL
    near_only = counts or (quantity == AWAY and fold == NEAREST and chance[1] == 0.0)
    merely, nearest = near_only and plain and not (veiled or narrow), every(inf)
    place, (sums, count) = place_in(vicinity, ball, near, robot), ((0.0, 0.0, -inf), 0.0)
    block, walk = begin_walk(vicinity, ball, place)
    room, ways = stack_room(ROOM), stack_room(WAYS)
    while walk[0] < walk[1]:
        walk, taken, passed, nearest = find_some(
            vicinity, ball, points, robot, place, least, block, walk, merely, room, ways if veiled else 0, nearest
        )
        count += passed
        if veiled and taken > 0:
            taken = visible(vicinity, near, robot, seen, walls, discs, room, ways, taken)
        if narrow:
            taken = kernels_field.in_field(vicinity, ball, near, robot, place, room, taken)
        if plain and counts:
            count += float(taken)
        elif plain and quantity == HEADING and fold == DIRECTION and not turn[0]:
            sums, count = add_headings(near, points, room, taken, sums, count)
        elif fold == LISTED:
            count = list_some(near, ball, points, chance, robot, place, colour, room, taken, listed, count)
        else:
            asked = quantity, fold, row, colour, middle
            sums, count = fold_some(near, ball, points, chance, asked, robot, place, turn, room, taken, sums, count)
    found, other_found, best = sums
    if counts and plain:
        found = count
    elif merely:
        found = least_in(np.sqrt(nearest))
    return found, other_found, count, best


@woven
def place_in(vicinity, ball, near, robot):
    """Where a robot is in the frame of the sorted points, m."""
    margin = real_at(vicinity, MARGIN) if long_at(near, TORUS) else 0.0
    x, y = real_at(long_at(near, OWN_X), robot) + margin, real_at(long_at(near, OWN_Y), robot) + margin
    return x, y, 0.0 if ball is None else height_of(long_at(near, OWN_Z), robot)


@woven
def points_of(vicinity, ball):
    """Where the x, y and z of the sorted points lie, and whose they are."""
    z = 0 if ball is None else long_at(vicinity, SORTED_Z)
    return long_at(vicinity, SORTED_X), long_at(vicinity, SORTED_Y), z, long_at(vicinity, SORTED_WHOSE)


@woven
def chance_of(near):
    """Loss and noise."""
    return real_at(near, LOSS), real_at(near, NOISE)


@woven
def turn_of(near, robot):
    """Whether a robot may sense another heading than its true one, and sine and cosine of the difference."""
    if not long_at(near, TURNED):
        return False, 0.0, 1.0
    sensed, own = long_at(near, SENSED_HEADING), long_at(near, OWN_HEADING)
    sine, cosine = sine_cosine(wrap(real_at(sensed, robot) - real_at(own, robot)))
    return True, sine, cosine


@woven
def begin_walk(vicinity, ball, place):
    """The cells around a place: the first column and the one after the last, the end of the last layer's rows, the
    rows of a layer and those that are not passed; and a walk along them: the row that comes next, the end of its
    layer's, and the next point."""
    (x, y, z), size, reach = place, real_at(vicinity, SIZE), real_at(vicinity, REACH)
    columns, rows = long_at(vicinity, COLUMNS), long_at(vicinity, ROWS)
    line, high, left, right = cells_around(x, y, size, columns, rows, reach)
    last, others = high, rows - (high - line)
    if ball is not None:
        bottom, top = layers_around(z, size, long_at(vicinity, LAYERS), reach)
        line, high, last = line + bottom * rows, high + bottom * rows, high + top * rows
    point = np.int64(whole_at(long_at(vicinity, START), line * columns + left))
    return (left, right, last, rows, others), (line, high, point)


@woven
def find_some(vicinity, ball, points, robot, place, least, block, walk, merely, room, ways, nearest):
    """Go on with a walk until AT_ONCE points are found whose squares are at most `least`, or it ends: they are written
    into a room, and the ways to them, if `ways` is not 0. Gives the walk and how many they are; and how many were only
    counted, as are all where `merely` is true, with the least squares of these and of `nearest`."""
    (left, right, last, rows, others), (line, high, point) = block, walk
    columns, start, order = long_at(vicinity, COLUMNS), long_at(vicinity, START), long_at(vicinity, ORDER)
    taken, passed = 0, 0.0
    while line < high and taken < AT_ONCE:
        stop = whole_at(start, line * columns + right)
        end = min(stop, point + AT_ONCE - taken)
        for each in range(point, end, LANES):
            dx, dy, squares = ways_to(ball, points, place, each)
            close = (squares <= least) & (wholes_at(order, each) != I(robot)) & (places() < I(end - each))
            if merely:  # who the neighbours are does not matter
                passed += float(how_many(close))
                nearest = least_of(nearest, either(close, squares, inf))
                continue
            pack_at(room, taken, places() + I(each), close)
            if ways:
                pack_at(ways, taken, singles(dx), close)
                pack_at(ways, taken + ROW, singles(dy), close)
            taken += np.int64(how_many(close))
        point = end
        if point == stop:
            line += 1
            if ball is not None and line == high and high < last:  # the first row of the next layer
                line, high = line + others, high + rows
            point = np.int64(whole_at(start, min(line, high - 1) * columns + left))
    return (line, high, point), taken, passed, nearest


@woven
def ways_to(ball, points, place, first):
    """The ways to the LANES sorted points from `first` on: x, y and the squares of their lengths, m."""
    (sorted_x, sorted_y, sorted_z, _), (own_x, own_y, own_z) = points, place
    dx, dy = reals_at(sorted_x, first) - own_x, reals_at(sorted_y, first) - own_y
    squares = dx * dx + dy * dy
    if ball is not None:
        dz = reals_at(sorted_z, first) - own_z
        squares = squares + dz * dz
    return dx, dy, squares


@woven
def add_headings(near, points, room, taken, sums, count):
    """Add the cosines and sines of so many points in a room."""
    (found, other_found, best), (_, _, _, whose) = sums, points
    cosines, sines = long_at(near, COSINE), long_at(near, SINE)
    for index in range(taken):
        other = np.int64(whole_at(whose, np.int64(whole_at(room, index))))
        found, other_found = found + real_at(cosines, other), other_found + real_at(sines, other)
    return (found, other_found, best), count + float(taken)


@woven
def list_some(near, ball, points, chance, robot, place, colour, room, taken, listed, count):
    """List those of so many points in a room that a robot senses, after so many; gives their number together."""
    measured = chance[1] > 0.0
    for index in range(taken):
        is_sensed, other, _ = sense(near, ball, points, chance, robot, place, colour, measured, whole_at(room, index))
        if is_sensed:
            put_long(listed, np.int64(count), robot << 32 | other)
            count += 1.0
    return count


@woven
def fold_some(near, ball, points, chance, asked, robot, place, turn, room, taken, sums, count):
    """Fold what is asked for of those of so many points in a room that a robot senses, see `gather`."""
    (quantity, fold, row, colour, middle), (turned, sine, cosine) = asked, turn
    found, other_found, best = sums
    measured = quantity == AWAY or fold == NEAREST or chance[1] > 0.0
    for index in range(taken):
        point = whole_at(room, index)
        is_sensed, other, way = sense(near, ball, points, chance, robot, place, colour, measured, point)
        if not is_sensed:
            continue
        dx, dy, dz, away = way
        if turned:
            dx, dy = rotated(dx, dy, sine, cosine)
        value, across = value_of(near, quantity, row, other, turn, (dx, dy, dz, away))
        if value != value:
            continue
        count += 1.0
        if fold in (TOTAL, MEAN, DIRECTION):
            found, other_found = found + value, other_found + across
        elif fold in (LEAST, MOST):
            value = -value if fold == LEAST else value
            best = best if best > value else value  # of 0 and -0 the later one, as NumPy
        else:
            key = -away
            if fold == OUTLIER:
                dx, dy = dx - middle[0], dy - middle[1]
                key = sqrt(dx * dx + dy * dy)
            if key > best:
                found, best = value, key
    return (found, other_found, best), count


@woven
def sense(near, ball, points, chance, robot, place, colour, measured, point):
    """Whether a robot at this place senses a sorted point, of this colour unless that is NaN; whose it is; and the way
    to it as it is sensed, m, with its length if that is `measured`."""
    (sorted_x, sorted_y, sorted_z, whose), (own_x, own_y, own_z), at = points, place, np.int64(point)
    dx, dy, dz = real_at(sorted_x, at) - own_x, real_at(sorted_y, at) - own_y, 0.0
    squares, other = dx * dx + dy * dy, np.int64(whole_at(whose, at))
    if ball is not None:
        dz = real_at(sorted_z, at) - own_z
        squares = squares + dz * dz
    way = dx, dy, dz, sqrt(squares) if measured else 0.0
    if colour == colour and real_at(long_at(near, SHARED), other) != colour:
        return False, other, way
    is_sensed, way = by_chance(near, ball, chance, robot, other, way)
    return is_sensed, other, way


@woven
def by_chance(near, ball, chance, robot, other, way):
    """Whether no loss keeps a robot from sensing another one, and how it senses the way to it, m, with its length."""
    (loss, noise), (dx, dy, dz, away) = chance, way
    if not (loss > 0.0 or noise > 0.0):
        return True, way
    multiple = ((U(other) << U(32)) + U(robot)) * GOLDEN
    if loss > 0.0 and float(mixed(multiple, U(long_at(near, LOST_KEY))) >> U(11)) * 2.0**-53 < loss:
        return False, way
    if noise > 0.0:
        wide = noise * away
        dx = dx + wide * deviate(mixed(multiple, U(long_at(near, ACROSS_KEY))))
        dy = dy + wide * deviate(mixed(multiple, U(long_at(near, UP_KEY))))
        squares = dx * dx + dy * dy
        if ball is not None:
            dz = dz + wide * deviate(mixed(multiple, U(long_at(near, ABOVE_KEY))))
            squares = squares + dz * dz
        away = sqrt(squares)
    return True, (dx, dy, dz, away)


@woven
def value_of(near, quantity, row, other, turn, way):
    """A quantity of a neighbour to which this way leads; of directions the cosine, and the sine."""
    (dx, dy, dz, away), (turned, sine, cosine) = way, turn
    if quantity == DX:
        return dx, 0.0
    if quantity == DY:
        return dy, 0.0
    if quantity == DZ:
        return dz, 0.0
    if quantity == AWAY:
        return away, 0.0
    if quantity == HEADING:
        along, across = real_at(long_at(near, COSINE), other), real_at(long_at(near, SINE), other)
        return rotated(along, across, sine, cosine) if turned else (along, across)
    if quantity in (VALUE, ANGLE):
        value = real_at(long_at(near, SHARED), row * long_at(near, COUNT) + other)
        if quantity == VALUE:
            return value, 0.0
        across, along = sine_cosine(wrap(value))
        return along, across
    return 1.0, 0.0


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

"""Who gives way where there is no room for one more: whoever makes many entries loses their own. Loaded only then."""

_FORGOTTEN = "?"
_MAX_STREAMS, _MAX_TELLERS = 8, 4


def gives_way(owners, new=None):
    """Whose entry gives way to one more of `new`: the first of the owner who has the most. owners: of the entries, the
    one that gives way first in front."""
    most, first = 0, 0
    for at, owner in enumerate(owners):
        count = owners.count(owner) + (owner == new)
        if count > most:
            most, first = count, at
    return first


def named(table, names, key):
    """Drop one of these entries of a table; their names begin with a key. key: whose new entry needs the room."""
    names = list(names)
    del table[names[gives_way([each[0] for each in names], key)]]


def heard(table, key):
    """Drop what was heard of one sender, the one silent longest of its key."""
    named(table, sorted(table, key=lambda each: table[each][2]), key)


def streams(table, key):
    """Drop a stream, one without standing commands first."""
    named(table, [each for each in table if not table[each][1]] or table, key)


def pieces(table, which):
    """Drop the pieces of another message than this one."""
    named(table, sorted([each for each in table if each != which]), which[0])


def marks(rows, most, ended):
    """Drop STOPs until there is room for so many, with those that are counted. ended: where they hold, those that have
    ended; then what is dropped is counted. None where they have ended themselves."""
    places = [at for at, each in enumerate(rows) if each[0] != _FORGOTTEN]
    if len(places) >= most:
        del rows[places[gives_way([rows[at][3] or rows[at][0] for at in places])]]
        if ended is not None:
            forget(rows, ended)


def forget(rows, ended):
    """Count one more STOP that holds and for which there is no room."""
    before = [each for each in rows if each[0] == _FORGOTTEN]
    number = max([0] + [each[2] for each in before + ended if each[0] == _FORGOTTEN]) + 1
    for each in before:
        rows.remove(each)
    rows.append([_FORGOTTEN, 0, number, ""])


def told(table, teller, theirs):
    """Remember what a key tells of streams: of as many as there is room for, and of four keys."""
    before = table.pop(teller, {})
    for each in before:  # robots may share a key: of some streams one has more, of others another one
        if each in theirs or len(theirs) < _MAX_STREAMS:
            theirs[each] = max(theirs.get(each, 0), before[each])
    for each in sorted(theirs)[_MAX_STREAMS:]:
        del theirs[each]
    while len(table) >= _MAX_TELLERS:
        del table[next(iter(table))]
    table[teller] = theirs

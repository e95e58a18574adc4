"""What a terminal shows: a program's output drawn on a grid of characters, as far as full-screen programs need it."""

from __future__ import annotations

import codecs
import re

_CONTROL = re.compile(
    r"\x1b\[(?P<private>[?>=]?)(?P<numbers>[0-9;]*)(?P<what>[@-~])|\x1b[()=>].?|\x1b\][^\x07]*\x07|\x1b[^\[\]()=>]"
)


class Picture:
    """A screen of so many columns and rows."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self._rest = ""
        self._clear()

    def _clear(self) -> None:
        self._cells = [[" "] * self.columns for _ in range(self.rows)]
        self._x = self._y = 0

    @property
    def lines(self) -> list[str]:
        """The lines, without blanks at their ends."""
        return ["".join(row).rstrip() for row in self._cells]

    def __str__(self) -> str:
        return "\n".join(map("".join, self._cells))

    def feed(self, data: bytes) -> None:
        """Show what a program has written."""
        text = self._rest + self._decoder.decode(data)
        self._rest = ""
        while text:
            if text[0] != "\x1b":
                self._put(text[0])
                text = text[1:]
                continue
            found = _CONTROL.match(text)
            if found is None:
                self._rest = text  # the end of it is still to come
                return
            if found["what"]:
                self._obey(found["private"], found["numbers"], found["what"])
            text = text[found.end() :]

    def _put(self, character: str) -> None:
        if character == "\r":
            self._x = 0
        elif character == "\n":
            self._y = min(self._y + 1, self.rows - 1)
        elif character == "\b":
            self._x = max(0, self._x - 1)
        elif character.isprintable():
            self._cells[self._y][min(self._x, self.columns - 1)] = character
            self._x += 1

    def _obey(self, private: str, numbers: str, what: str) -> None:
        given = [int(number or 0) for number in numbers.split(";")]
        count = max(1, given[0])
        if private:
            if what in "hl" and 1049 in given:
                self._clear()
        elif what in "AB":
            self._y = max(0, min(self.rows - 1, self._y + (count if what == "B" else -count)))
        elif what in "CD":
            self._x = max(0, min(self.columns - 1, self._x + (count if what == "C" else -count)))
        elif what in "Hf":
            self._y, self._x = count - 1, max(1, given[1] if len(given) > 1 else 1) - 1
        elif what == "J":
            first = 0 if given[0] == 2 else self._y
            for row in range(first, self.rows):
                begin = self._x if row == self._y and given[0] == 0 else 0
                self._cells[row][begin:] = [" "] * (self.columns - begin)
        elif what == "K":
            self._cells[self._y][self._x :] = [" "] * (self.columns - self._x)

"""The widget that `fleet.view()` gives, for every notebook that shows anywidgets: Jupyter, marimo, VS Code, Colab."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

import anywidget
import traitlets

from sleepcast.notebook.desk import NotebookDesk
from sleepcast.notebook.page import page

HEIGHT = 620
"""Pixels of a view: map, prompt, and the first lines of the account."""


class FleetWidget(anywidget.AnyWidget):
    """Map and prompt of a fleet in a notebook. Where no browser shows widgets (a notebook that was saved, or run by a
    program), it is the picture of the fleet.

    page: its markup.
    height: in pixels.
    """

    _esm = (files("sleepcast.notebook") / "widget.js").read_text(encoding="utf-8")
    page = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int(HEIGHT).tag(sync=True)

    def __init__(self, desk: NotebookDesk, picture: Callable[[], str], text: Callable[[], str]) -> None:
        super().__init__(page=page())
        self._picture, self._text = picture, text
        view = desk.view(self)
        self.on_msg(lambda _, content, __: view.take(content))

    def tell(self, content: dict[str, object], picture: bytes | None = None) -> None:
        """See `Line`."""
        self.send(content, None if picture is None else [picture])

    def __repr__(self) -> str:
        return f"view of {self._text()}"

    def _repr_mimebundle_(self, **options: object) -> tuple[dict[str, object], dict[str, object]] | None:
        bundle = super()._repr_mimebundle_()
        if bundle is None:
            return None
        data, metadata = bundle
        return {**data, "text/plain": repr(self), "text/html": self._picture()}, metadata

"""The operator's page in a notebook: map and prompt of a fleet as a widget, which is what `fleet.view()` gives.

page      the page as one text: its files, put together        desk      what lies behind all views of a fleet
widget    for Jupyter, marimo and the like; `widget.js` is     fleets    the desk of a simulated fleet, and of
          its end in the browser                                         one on the air

Needs the libraries of the extra `notebook`.
"""

from __future__ import annotations

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing

try:
    import anywidget  # noqa: F401 - the first of these modules that needs it would not say what to do
except ModuleNotFoundError as error:
    raise MisuseError(f"fleet.view() needs anywidget; to install it: {installing('notebook')}") from error

from sleepcast.notebook.desk import NotebookDesk
from sleepcast.notebook.fleets import connected_desk, simulated_desk
from sleepcast.notebook.widget import FleetWidget

__all__ = ["FleetWidget", "NotebookDesk", "connected_desk", "simulated_desk"]

"""Many simulated bodies in one world, described by scenario files.

`settings` and `scenario` read the files, `groups`, `signals` and `measures` parts of them, `mission` the scripts,
`gallery` finds them; `bodies`, `body`, `motion`, `sonar` and `senses` are the bodies; `simulation` puts them together.
"""

from sleepcast.simulator.bodies import Saying
from sleepcast.simulator.body import Body
from sleepcast.simulator.gallery import find_scenario, scenario_names
from sleepcast.simulator.mission import MissionError, Order, parse_mission, read_mission
from sleepcast.simulator.scenario import Place, ReadyCommand, Scenario, Store, load
from sleepcast.simulator.settings import SettingsError
from sleepcast.simulator.simulation import Simulator

__all__ = [
    "Body",
    "MissionError",
    "Order",
    "Place",
    "ReadyCommand",
    "Saying",
    "Scenario",
    "SettingsError",
    "Simulator",
    "Store",
    "find_scenario",
    "load",
    "parse_mission",
    "read_mission",
    "scenario_names",
]

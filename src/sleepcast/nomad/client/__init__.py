"""A robot behind a server of Nomads, for Python programs: `Nomad`, and what its calls take, give and raise."""

from sleepcast.nomad.client.nomad import (
    Kind,
    LostError,
    Nomad,
    NomadError,
    Pose,
    RefusedError,
    RequestError,
    Stamp,
    State,
)

__all__ = ["Kind", "LostError", "Nomad", "NomadError", "Pose", "RefusedError", "RequestError", "Stamp", "State"]

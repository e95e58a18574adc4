"""A vehicle that takes missions and fences, made with MAVSDK: `python mavsdk_vehicle.py PORT` sends to 127.0.0.1:PORT,
and prints the commands of each mission that it has got."""

from __future__ import annotations

import sys

from mavsdk.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw_server import MissionPlan, MissionRawServer


def show(result: object, plan: MissionPlan, _: object) -> None:
    print(f"{result}: {[item.command for item in plan.mission_items]}", flush=True)


def main() -> None:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
    sdk.add_any_connection(f"udpout://127.0.0.1:{sys.argv[1]}")
    server = MissionRawServer(sdk.server_component(0))
    server.subscribe_incoming_mission(show, None)
    print("connected", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()

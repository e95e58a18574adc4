"""A program that is written with MAVSDK: it waits until a vehicle is ready, and then does what it is told in lines, of
which it prints what came: `python mavsdk_program.py PORT`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission_raw import MissionItem, MissionRaw
from mavsdk.plugins.offboard import Offboard, PositionNedYaw, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

THERE = (36.6003604, -121.8996646)
PATIENCE = 60.0
ITEM = MissionItem(0, 6, 16, 1, 1, 0.0, 0.0, 0.0, 0.0, 366_003_604, -1_218_996_646, 10.0, 0)


def ready(telemetry: Telemetry) -> None:
    """What every tutorial of MAVSDK begins with."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        health = telemetry.health()
        if health.is_global_position_ok and health.is_home_position_ok:
            print(f"ready, all ok: {telemetry.health_all_ok()}", flush=True)
            return
        time.sleep(0.05)
    print("never ready", flush=True)


def main() -> None:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    system = sdk.first_autopilot(PATIENCE)
    action, telemetry, offboard = Action(system), Telemetry(system), Offboard(system)
    missions, parameters = MissionRaw(system), Param(system)
    telemetry.subscribe_status_text(lambda text, _: print(f"text: {text.text}", flush=True), None)
    orders: dict[str, Callable[[], Any]] = {
        "arm": action.arm,
        "hold": action.hold,
        "kill": action.kill,
        "force": action.arm_force,
        "terminate": action.terminate,
        "goto": lambda: action.goto_location(*THERE, 10.0, 0.0),
        "north": lambda: offboard.set_velocity_ned(VelocityNedYaw(0.1, 0.0, 0.0, 0.0)),
        "up": lambda: offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, -0.1, 0.0)),
        "place": lambda: offboard.set_position_ned(PositionNedYaw(3.0, 2.0, -1.0, 0.0)),
        "offboard": offboard.start,
        "ready": lambda: ready(telemetry),
        "often": lambda: telemetry.set_rate_position(10.0),
        "imu": lambda: telemetry.set_rate_imu(10.0),
        "number": lambda: parameters.get_param_float("SYSID_THISMAV"),
        "battery": lambda: telemetry.battery().voltage_v,
        "download": missions.download_mission,
        "clear": missions.clear_mission,
        "upload": lambda: missions.upload_mission([ITEM]),
    }
    print("connected", flush=True)
    for line in sys.stdin:
        order = line.strip()
        try:
            answer = orders[order]()
        except Exception as error:  # each plugin of MAVSDK has its own
            print(f"{order}: {error}", flush=True)
        else:
            print(f"{order}: done: {answer}", flush=True)


if __name__ == "__main__":
    main()

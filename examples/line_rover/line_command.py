"""A command of sleepcast: `sleepcast line-look line://HOST:PORT`. Found by its entry point in `sleepcast.commands`."""

import click

from sleepcast.bridges import open_robot


@click.command("line-look")
@click.argument("uri")
def look(uri: str) -> None:
    """Say what the rover at URI measures."""
    with open_robot(uri) as rover:
        values = rover.sense().values
        for sensor, value in zip(rover.model.sensors, values, strict=True):
            click.echo(f"{sensor.name} {value:.3f} {sensor.unit}".rstrip())

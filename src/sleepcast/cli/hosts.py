"""The option that says by which names a page may be asked for."""

from __future__ import annotations

import click

allow_host_option = click.option(
    "--allow-host",
    "allow",
    metavar="NAME",
    multiple=True,
    help="Page: a name, as robots.local or robots.local:80, by which others may ask for it; may be repeated.",
)

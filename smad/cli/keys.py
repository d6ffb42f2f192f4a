"""`smad keys`: a key pair for a client on another machine."""

from pathlib import Path

import click

from smad.cli.options import PATH, Command, argument
from smad.errors import ConfigError, refused_by_system


@click.command(cls=Command)
def keys(path: Path = argument(PATH)) -> None:
    """Make a key pair for a client on another machine.

    PATH gets both CURVE keys. The public key goes into daemon.tcp.allowed_keys of the bench;
    the file stays with the client.
    """
    from smad.client.endpoints import new_key_file

    action = "choose another file; keys are never overwritten"
    with refused_by_system(ConfigError, f"cannot write {path}", action=action):
        public, _ = new_key_file(path)
    click.echo(f"{path} written; only you can read it")
    click.echo(f'in the bench\'s configuration: allowed_keys = ["{public.decode()}"]')

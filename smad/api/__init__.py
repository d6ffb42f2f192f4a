"""Every command, reply and telemetry field of the daemon, typed and documented.

The one list of what a client can ask is `METHODS`. The command server, both clients and the
reference in docs/guide/clients.md are made from it; motion commands are those of
`smad.control.commands`, samples are those of `smad.runlog.schema`.
"""

from smad.api.methods import *
from smad.api.refusals import *
from smad.api.replies import *
from smad.api.stream import *

"""The TOML configuration: typed sections with units in the names, checked on load.

`load_config(path)` reads a file, `Config()` is a complete default, `default_toml()` writes it out.
"""

from smad.config.axes import *
from smad.config.control import *
from smad.config.hooks import *
from smad.config.load import *
from smad.config.model import *
from smad.config.template import *

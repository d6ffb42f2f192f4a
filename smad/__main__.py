"""`python -m smad` is `smad`."""

from smad.cli import main

main()

"""A bench with a hidden effect on a pseudo-terminal, and the product asked about many of them."""

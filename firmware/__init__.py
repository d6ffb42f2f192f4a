"""What a lab flashes: the core in C99, its ports, and tools that build and compare them."""

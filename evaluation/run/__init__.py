"""The product asked about every case of a bank."""

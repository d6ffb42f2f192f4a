"""Towards the clients: sockets to messages to commands to replies, who may command, the status."""

"""The daemon: one asyncio process that owns the serial port and runs the control loop.

The board's clock paces it; clients command it over ZeroMQ and cannot hold a control step up.
"""

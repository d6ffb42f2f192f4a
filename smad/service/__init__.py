"""What lets the daemon run as a service: a unit for systemd, a rule for udev, and their places."""

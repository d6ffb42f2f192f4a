"""A verdict in words and as a page. Nothing here decides."""

"""Short tours through places."""

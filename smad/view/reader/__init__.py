"""What reads logs and makes plans for the page's server, in a process of its own."""

"""The reader process of the page's server: it reads logs and makes plans, a line of JSON each."""

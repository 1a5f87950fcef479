"""Messages, results and exit statuses of all commands and the Python interface."""

"""Messages, results and exit statuses of all commands and of the Python interface."""

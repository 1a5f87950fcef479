"""Messages, results and exit statuses of the commands and the Python interface."""

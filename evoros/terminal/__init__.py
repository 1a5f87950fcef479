"""Messages, results and exit statuses of every command and the Python interface."""

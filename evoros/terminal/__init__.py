"""Messages, results and exit statuses, as every command and the Python interface give them."""

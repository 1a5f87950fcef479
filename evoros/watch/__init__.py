"""The subcommand ``watch``: a page in the browser that follows runs while they go on."""

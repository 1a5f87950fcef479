"""Types of sensors: what a sensor sees, how often and how well."""

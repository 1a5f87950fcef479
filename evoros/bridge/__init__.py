"""Processes outside: started in namespaces of their own, spoken to in lock-step, ended for sure."""

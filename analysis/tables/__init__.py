"""From folders to tables: runs, evaluations, and what they have in common."""

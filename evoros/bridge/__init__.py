"""External processes of missions, with isolation, lock-step pipes and reliable termination."""

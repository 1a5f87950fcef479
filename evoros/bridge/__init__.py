"""External processes of missions: isolation, lockstep pipes and reliable termination."""

"""External processes for missions: isolation, lockstep pipes and reliable termination."""

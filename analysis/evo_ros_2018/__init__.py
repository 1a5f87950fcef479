"""Claims and special figures of the 2018 paper on Evo-ROS; optional, as no room imports it."""

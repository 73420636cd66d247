"""The machine: EMIR's hydraulics and mechanics. No ROS, no clock, no prints."""

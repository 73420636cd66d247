"""The ROS 2 graph: thin nodes about the machine and its control. Nobody imports this package."""

import os
import sys

# ROS from the package index lies in the environment itself, and no set-up file says so.
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)

#!/bin/sh
# What `ros2 run emir_ros <name>` starts: the module of that name, with the interpreter of the
# environment this file is installed in or, in a colcon workspace, the sourced one.
# -P: what lies in the current folder is not imported.
prefix=$(cd "$(dirname "$0")/../.." && pwd)
python="$prefix/bin/python"
[ -x "$python" ] || python=python3
exec "$python" -P -m emir_ros.start "$(basename "$0")" "$@"

#!/bin/sh
# What `ros2 run emir_ros <name>` starts: the module of that name, with the interpreter of the
# environment this file is installed in or, in a colcon workspace, the sourced one.
prefix=$(dirname "$(dirname "$(dirname "$0")")")
python="$prefix/bin/python"
[ -x "$python" ] || python=python3
exec "$python" -m "emir_ros.$(basename "$0")" "$@"

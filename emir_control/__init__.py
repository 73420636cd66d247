"""The control algorithms. Frozen parameters, run state in and out; no ROS, no clock, no prints.

Every algorithm has `initial(...) -> state` and `step(state, inputs, dt) -> (state, outputs)`;
inputs and outputs are named tuples in SI units, dt is the control period in s.
"""

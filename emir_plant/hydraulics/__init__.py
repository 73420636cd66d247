"""The hydraulic actuator of paper 2.2, Fig. 4: valve, flow paths, logic block, chambers."""

"""Where things are on a machine, and a simulated one."""

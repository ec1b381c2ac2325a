"""The reachable space, bounds, and all optimal plans of tasks as paths of a plan space."""

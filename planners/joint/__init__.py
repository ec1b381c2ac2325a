"""The joint model: states, conditions, interference, and the joint actions that robots compose."""
